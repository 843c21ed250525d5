"""The command `python -m keras_pendulum.compare`: several runs in one figure and one table."""

# PYTHON_ARGCOMPLETE_OK
from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from keras_pendulum.cli import OneLineParser, nonempty_path, require_ending, run_command
from keras_pendulum.compare.folders import find_checkpoints
from keras_pendulum.completion import complete_with, folders
from keras_pendulum.storage.atomic_write import require_no_other_file, write_atomically
from keras_pendulum.tensorflow_setup import fast_import, require_tensorflow


def main(argv: Sequence[str] | None = None, prog: str = "python -m keras_pendulum.compare") -> int:
    """Compares the runs in the folders of the command line; returns the exit status."""
    parser = OneLineParser(
        prog=prog,
        description="Draw the learning curves of several runs of one task, and the regrets of "
        "their policies, and print a table.",
    )
    runs = parser.add_argument(
        "folders", nargs="+", type=nonempty_path, metavar="RUN_FOLDER", help="folder of a run"
    )
    parser.add_argument(
        "--out",
        type=nonempty_path,
        default="comparison.png",
        metavar="FILE.png",
        help="file of the figure [comparison.png]",
    )
    complete_with(runs, folders)
    arguments = parser.parse_args(argv)
    return run_command(lambda: _compare(arguments))


def _compare(arguments: argparse.Namespace) -> int:
    require_tensorflow()
    require_no_other_file(Path(arguments.out), b"\x89PNG", "a PNG")
    require_ending("--out", arguments.out, ".png")
    checkpoints = find_checkpoints(arguments.folders)

    with fast_import():
        from keras_pendulum.compare.figure import draw_comparison
        from keras_pendulum.compare.runs import best_possible, load_runs
        from keras_pendulum.compare.table import as_markdown
        from keras_pendulum.environments.tasks import task_name

    runs = load_runs(arguments.folders, checkpoints)
    write_atomically(arguments.out, draw_comparison(runs, best_possible(runs)))
    score = runs[0].score
    print(
        f"Greedy on {len(score.returns)} fixed starts, "
        f"{task_name(score.environment, score.gravity)}: best possible mean return "
        f"{score.optimal_mean_return:.2f}\n\n{as_markdown(runs)}\n\n"
        f"Learning curves and regrets: {arguments.out}"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
