"""The command `python -m keras_pendulum.train`."""

from __future__ import annotations

import argparse
import math
import shlex
import signal
import sys
import time
from collections.abc import Callable, Sequence
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
from keras_pendulum.config import Config
from keras_pendulum.display import require_display
from keras_pendulum.errors import UserError
from keras_pendulum.presets import PRESETS, preset

if TYPE_CHECKING:
    from keras_pendulum.episodes import EpisodeRecord
    from keras_pendulum.live_plot import LivePlot
    from keras_pendulum.run_folder import RunFolder
    from keras_pendulum.training import TrainingResult

_EVALUATION_EPISODES = 100


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
        require_display()
    live = _live_plot() if arguments.live else None

    with quick_import():
        from keras_pendulum.checkpoint import load_config
        from keras_pendulum.run_folder import RunFolder
        from keras_pendulum.training import train_dqn
        from keras_pendulum.weights import find_weights, load_weights

    if arguments.resume:
        if arguments.preset:
            settings["preset"] = arguments.preset
        config = replace(load_config(RunFolder(out).weights), **settings)
    init = load_weights(find_weights(arguments.init)) if arguments.init else None

    started = time.perf_counter()
    with _Interrupt(config) as interrupt:
        result = train_dqn(
            config,
            out,
            init=init,
            overwrite=arguments.overwrite,
            resume=arguments.resume,
            render=arguments.render,
            listeners=[_progress(config), interrupt.listen, *([live] if live else [])],
            should_stop=lambda: interrupt.asked,
        )
    if live:
        live.finish()
    _print_summary(result, RunFolder(out, config.environment), time.perf_counter() - started)
    return 0 if result.finished else 130


def _live_plot() -> LivePlot | None:
    from keras_pendulum.live_plot import LivePlot

    try:
        return LivePlot()
    except UserError as error:
        print(f"no live plot: {error}; the training goes on", file=sys.stderr)
        return None


class _Interrupt:
    """The first Ctrl-C asks the run to stop after its episode; the next one, or one after the
    last episode, ends the command at once.
    """

    def __init__(self, config: Config) -> None:
        self.asked = False
        self._last = config.episodes - 1

    def __enter__(self) -> _Interrupt:
        self._before = signal.signal(signal.SIGINT, self._ask)
        return self

    def __exit__(self, *problem: object) -> None:
        signal.signal(signal.SIGINT, self._before)

    def listen(self, record: EpisodeRecord) -> None:
        if record.episode == self._last:
            signal.signal(signal.SIGINT, self._before)

    def _ask(self, signum: int, frame: object) -> None:
        self.asked = True
        signal.signal(signal.SIGINT, self._before)


def _progress(config: Config) -> Callable[[EpisodeRecord], None]:
    """A bar on a terminal; elsewhere the original's line for each episode."""
    if not sys.stdout.isatty():
        return lambda record: print(record.line(), flush=True)
    import keras

    bar: keras.utils.Progbar | None = None
    first = 0

    def show(record: EpisodeRecord) -> None:
        nonlocal bar, first
        if bar is None:  # now it is known where a resumed run goes on
            first = record.episode
            names = ["return", "epsilon", "loss"]
            bar = keras.utils.Progbar(
                config.episodes - first, unit_name="episode", stateful_metrics=names
            )
        values = [("return", record.episode_return), ("epsilon", record.epsilon)]
        if not math.isnan(record.loss):
            values.append(("loss", record.loss))
        bar.update(record.episode + 1 - first, values)

    return show


def _print_summary(result: TrainingResult, folder: RunFolder, seconds: float) -> None:
    from keras_pendulum.evaluation import evaluate_policy, random_return

    last = result.history[-1]
    if sys.stdout.isatty() and not result.finished:
        print()  # the bar is still on its line
    state = "Trained" if result.finished else "Interrupted after"
    print(
        f"{state} {last.episode + 1} episodes ({last.environment_steps} steps, {last.updates} "
        f"updates); this took {seconds:.1f} s."
    )
    if result.finished:
        score = evaluate_policy(result.network, _EVALUATION_EPISODES)
        print(score.summary())
        chance = random_return(score.environment, score.gravity, _EVALUATION_EPISODES)
        print(f"Uniformly random actions on the same starts: {chance:.2f}")
    saved = ", ".join(file.name for file in folder.files if file.exists())
    print(f"Saved in {folder.path}: {saved}")
    if not result.finished:
        print(
            f"Go on: python -m keras_pendulum.train --resume --out {shlex.quote(str(folder.path))}"
        )


if __name__ == "__main__":
    sys.exit(main())
