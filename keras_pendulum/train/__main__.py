"""The command `python -m keras_pendulum.train`."""

# PYTHON_ARGCOMPLETE_OK
from __future__ import annotations

import argparse
import contextlib
import signal
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from keras_pendulum.cli import OneLineParser, nonempty_path, run_command
from keras_pendulum.completion import complete_with, names, paths, weights_files
from keras_pendulum.config.flags import add_config_flags, settings_from_args
from keras_pendulum.config.presets import PRESETS, preset
from keras_pendulum.errors import UserError
from keras_pendulum.storage.shipped_weights import shipped_names
from keras_pendulum.tensorflow_setup import fast_import
from keras_pendulum.train.closing_lines import next_lines, result_lines
from keras_pendulum.train.listeners import Listener
from keras_pendulum.train.progress import Progress, make_progress

if TYPE_CHECKING:
    from keras_pendulum.config.config import Config
    from keras_pendulum.history import EpisodeRecord
    from keras_pendulum.storage.run_folder import RunFolder
    from keras_pendulum.train.live_plot import LivePlot
    from keras_pendulum.train.result import TrainingResult


def main(argv: Sequence[str] | None = None, prog: str = "python -m keras_pendulum.train") -> int:
    """Trains as the command line says; returns the exit status."""
    parser = OneLineParser(
        help_all=True,
        prog=prog,
        description="Train a DQN on the pendulum or on CartPole, and evaluate it.",
        epilog="Ctrl-C saves a checkpoint; --resume continues from it.",
    )
    preset_flag = parser.add_argument(
        "--preset", type=nonempty_path, help=f"{', '.join(PRESETS)} [reference]"
    )
    init_flag = parser.add_argument(
        "--init", type=nonempty_path, metavar="FILE.h5", help="start from these weights"
    )
    out_flag = parser.add_argument(
        "--out", type=nonempty_path, metavar="DIR", help="folder of the run [runs/PRESET-seedN]"
    )
    rerun = parser.add_mutually_exclusive_group()
    rerun.add_argument(
        "--resume", action="store_true", help="continue from the last checkpoint in DIR"
    )
    rerun.add_argument("--overwrite", action="store_true", help="replace the run in DIR")
    shown = parser.add_mutually_exclusive_group()
    shown.add_argument("--live", action="store_true", help="draw the learning curve during the run")
    shown.add_argument("--render", action="store_true", help="show the environment in a window")
    parser.add_argument("--quiet", action="store_true", help="print only the closing lines")
    parser.add_argument(
        "--tensorboard", action="store_true", help="write DIR/tensorboard (extra `tensorboard`)"
    )
    add_config_flags(parser)
    parser.suggest_flag("--preset", PRESETS)
    complete_with(preset_flag, names(PRESETS))
    complete_with(init_flag, weights_files(shipped_names))
    complete_with(out_flag, paths)
    arguments = parser.parse_args(argv)
    return run_command(lambda: _train(arguments))


def _train(arguments: argparse.Namespace) -> int:
    settings = settings_from_args(arguments)
    # The settings of a resumed run are in its checkpoint, so these only name its folder.
    used = {name: settings[name] for name in settings if name == "seed" or not arguments.resume}
    config = preset(arguments.preset or "reference", **used)
    out = Path(arguments.out or Path("runs") / f"{config.preset}-seed{config.seed}")
    if arguments.resume and arguments.init:
        raise UserError("--init starts a new run, --resume continues one: give only one of them")

    with fast_import():
        from keras_pendulum.storage.find_weights import find_weights
        from keras_pendulum.storage.load_weights import load_weights
        from keras_pendulum.storage.recorded_run import load_recorded_run
        from keras_pendulum.storage.run_folder import RunFolder
        from keras_pendulum.train.tensorboard import TensorBoardLog
        from keras_pendulum.train.train_dqn import train_dqn

    if arguments.resume:
        if arguments.preset:
            settings["preset"] = arguments.preset
        run = _run_to_resume(out)
        config = load_recorded_run(run.weights).config
        run.warn_if_edited(config)
        config = config.change(**settings)
    init = None
    if arguments.init:
        init = load_weights(find_weights(arguments.init), config.activation)

    folder = RunFolder(out, config.environment)
    log = TensorBoardLog(folder.events, config) if arguments.tensorboard else None
    live = _live_plot(config) if arguments.live else None
    progress = make_progress(config, arguments.quiet)
    report = _Report(config, folder, progress)
    try:
        with _Interrupt() as interrupt:
            result = train_dqn(
                config,
                out,
                init=init,
                overwrite=arguments.overwrite,
                resume=arguments.resume,
                render=arguments.render,
                listeners=[each for each in (log, progress, live, report) if each],
                should_stop=lambda: interrupt.asked,
            )
    finally:
        progress.end()
    print(next_lines(config, result, folder, new_episodes=report.new_episodes), flush=True)
    if live and live.is_open and not interrupt.asked:
        print("The window of the learning curve is open: close it to end", flush=True)
        with contextlib.suppress(KeyboardInterrupt):  # Ctrl-C closes it, too
            live.wait_until_closed()
    return 130 if interrupt.asked else 0


def _run_to_resume(out: Path) -> RunFolder:
    from keras_pendulum.storage.run_folder import find_run

    try:
        return find_run(out)
    except UserError as error:
        raise UserError(
            f"{error}; leave out --resume to start a run, or name the folder of one with --out"
        ) from error


def _live_plot(config: Config) -> LivePlot | None:
    from keras_pendulum.train.live_plot import LivePlot

    try:
        return LivePlot(config)
    except UserError as error:
        print(f"no live plot: {error}; the training continues", file=sys.stderr)
        return None


class _Report(Listener):
    """Prints the result of a run before its picture is drawn."""

    def __init__(self, config: Config, folder: RunFolder, progress: Progress) -> None:
        self._run = config, folder
        self._progress = progress
        self._started = time.perf_counter()
        self.new_episodes = 0

    def on_episode(self, record: EpisodeRecord) -> None:
        self.new_episodes += 1

    def on_result(self, result: TrainingResult) -> None:
        config, folder = self._run
        seconds = time.perf_counter() - self._started
        self._progress.on_phase("finished" if result.finished else "interrupted")
        self._progress.end()
        lines = result_lines(config, result, folder, seconds, new_episodes=self.new_episodes)
        print(lines, flush=True)


class _Interrupt:
    """The first Ctrl-C stops the run after its episode, with a checkpoint; the second at once."""

    def __init__(self) -> None:
        self.asked = False

    def __enter__(self) -> _Interrupt:
        # Also where SIGINT was ignored, so that `kill -INT` stops a run in the background.
        self._before = signal.signal(signal.SIGINT, self._ask)
        return self

    def __exit__(self, *exception: object) -> None:
        signal.signal(signal.SIGINT, self._before)

    def _ask(self, signum: int, frame: object) -> None:
        self.asked = True
        signal.signal(signal.SIGINT, self._before)


if __name__ == "__main__":
    sys.exit(main())
