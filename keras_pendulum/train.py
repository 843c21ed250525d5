"""The command `python -m keras_pendulum.train`."""

# PYTHON_ARGCOMPLETE_OK
from __future__ import annotations

import argparse
import shlex
import signal
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from keras_pendulum.backend import quick_import, require_tensorflow
from keras_pendulum.command_line import (
    OneLineParser,
    add_config_flags,
    name,
    run_command,
    typed_settings,
)
from keras_pendulum.display import require_display
from keras_pendulum.environment import TASKS
from keras_pendulum.errors import UserError
from keras_pendulum.lost_window import LossGuard
from keras_pendulum.presets import PRESETS, preset
from keras_pendulum.progress import make_progress

if TYPE_CHECKING:
    from keras_pendulum.live_plot import LivePlot
    from keras_pendulum.run_folder import RunFolder
    from keras_pendulum.training import TrainingResult


def main(argv: Sequence[str] | None = None) -> int:
    """Parses the command line and trains; returns the exit status."""
    parser = OneLineParser(
        prog="python -m keras_pendulum.train",
        description="Train a DQN to hold a pendulum or a pole up, and say how good it has become.",
        epilog="Ctrl-C saves a checkpoint; --resume goes on from it.",
    )
    parser.add_argument("--preset", type=name, help=f"{', '.join(PRESETS)} [reference]")
    parser.add_argument("--init", type=name, metavar="FILE.h5", help="start from these weights")
    parser.add_argument(
        "--out", type=name, metavar="DIR", help="folder of the run [runs/PRESET-seedN]"
    )
    rerun = parser.add_mutually_exclusive_group()
    rerun.add_argument("--resume", action="store_true", help="go on from DIR's last checkpoint")
    rerun.add_argument("--overwrite", action="store_true", help="replace the run that DIR holds")
    shown = parser.add_mutually_exclusive_group()
    shown.add_argument("--live", action="store_true", help="draw the returns while they come")
    shown.add_argument("--render", action="store_true", help="show the environment in a window")
    parser.add_argument("--quiet", action="store_true", help="print the closing lines alone")
    parser.add_argument(
        "--tensorboard", action="store_true", help="write DIR/tensorboard (extra `tensorboard`)"
    )
    add_config_flags(parser, skip=["preset"])
    arguments = parser.parse_args(argv)
    return run_command(lambda: _train(arguments))


def _train(arguments: argparse.Namespace) -> int:
    settings = typed_settings(arguments)
    config = preset(arguments.preset or "reference", **settings)
    out = Path(arguments.out or Path("runs") / f"{config.preset}-seed{config.seed}")
    if arguments.resume and arguments.init:
        raise UserError("--init starts a new run, --resume goes on with one: give one of them")
    require_tensorflow()
    if arguments.render:
        LossGuard()  # without its window the training goes on
        require_display()
    live = _live_plot() if arguments.live else None

    with quick_import():
        from keras_pendulum.checkpoint import load_config
        from keras_pendulum.run_folder import RunFolder
        from keras_pendulum.tensorboard_log import TensorBoardLog
        from keras_pendulum.training import train_dqn
        from keras_pendulum.weights import find_weights, load_weights

    if arguments.resume:
        if arguments.preset:
            settings["preset"] = arguments.preset
        config = replace(load_config(RunFolder(out).weights), **settings)
    init = load_weights(find_weights(arguments.init)) if arguments.init else None

    folder = RunFolder(out, config.environment)
    log = TensorBoardLog(folder.events, config) if arguments.tensorboard else None
    progress = None if arguments.quiet else make_progress(config)
    started = time.perf_counter()
    with _Interrupt() as interrupt:
        result = train_dqn(
            config,
            out,
            init=init,
            overwrite=arguments.overwrite,
            resume=arguments.resume,
            render=arguments.render,
            listeners=[each for each in (progress, live, log) if each],
            on_checkpoint=log.on_checkpoint if log else lambda network, episode: None,
            should_stop=lambda: interrupt.asked,
        )
    if live:
        live.finish()
    if sys.stdout.isatty() and progress and not result.finished:
        print()  # the bar is still on its line
    _print_summary(result, folder, time.perf_counter() - started, score=not interrupt.asked)
    return 130 if interrupt.asked else 0


def _live_plot() -> LivePlot | None:
    from keras_pendulum.live_plot import LivePlot

    try:
        return LivePlot()
    except UserError as error:
        print(f"no live plot: {error}; the training goes on", file=sys.stderr)
        return None


class _Interrupt:
    """The first Ctrl-C asks the run to stop after its episode and to keep what it has learned; the
    next one ends the command at once.
    """

    def __init__(self) -> None:
        self.asked = False

    def __enter__(self) -> _Interrupt:
        # Also where it was ignored: `kill -INT` then stops a run in the background.
        self._before = signal.signal(signal.SIGINT, self._ask)
        return self

    def __exit__(self, *problem: object) -> None:
        signal.signal(signal.SIGINT, self._before)

    def _ask(self, signum: int, frame: object) -> None:
        self.asked = True
        signal.signal(signal.SIGINT, self._before)


def _print_summary(
    result: TrainingResult, folder: RunFolder, seconds: float, *, score: bool
) -> None:
    from keras_pendulum.evaluation import evaluate_policy, random_return

    last = result.history[-1]
    state = "Trained" if result.finished else "Interrupted after"
    print(
        f"{state} {last.episode + 1} episodes ({last.environment_steps} steps, {last.updates} "
        f"updates); this took {seconds:.1f} s."
    )
    if score:
        greedy = evaluate_policy(result.network)
        print(greedy.summary())
        steps = TASKS[greedy.environment].steps_per_episode
        chance = random_return(greedy.environment, greedy.gravity, steps)
        print(f"Uniformly random actions on the same starts: {chance:.2f}")
    saved = ", ".join(file.name for file in folder.files if file.exists())
    print(f"Saved in {folder.path}: {saved}")
    print(_what_next(result, folder))


def _what_next(result: TrainingResult, folder: RunFolder) -> str:
    weights = shlex.quote(str(folder.path / folder.weights.name))
    if not result.finished:
        commands = {"Go on": f"train --resume --out {shlex.quote(str(folder.path))}"}
    elif TASKS[result.network.origin.environment].has_torque:
        commands = {
            "Watch it": f"evaluate {weights} --episodes 3 --render",
            "Play against it": f"play --against {weights}",
            "Take it to a browser": f"page {weights}",
        }
    else:
        commands = {"Watch it": f"evaluate {weights} --episodes 3 --render"}
    return "\n".join(f"{what}: python -m keras_pendulum.{do}" for what, do in commands.items())


if __name__ == "__main__":
    sys.exit(main())
