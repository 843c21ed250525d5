"""The command `python -m keras_pendulum.compare`: several runs in one figure and one table."""

# PYTHON_ARGCOMPLETE_OK
from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from keras_pendulum.cli import OneLineParser, nonempty_path, require_ending, run_command
from keras_pendulum.completion import complete_with, paths
from keras_pendulum.errors import UserError, one_line
from keras_pendulum.status import status
from keras_pendulum.storage.atomic_write import require_no_other_file, write_atomically
from keras_pendulum.tensorflow_setup import fast_import

if TYPE_CHECKING:
    from keras_pendulum.compare.runs import ComparedRun
    from keras_pendulum.storage.run_folder import RunFolder

_COLUMNS = ("run", "preset", "seed", "episodes", "updates", "mean return", "regret", "changes")
_NUMBERS = ("seed", "episodes", "updates", "mean return", "regret")  # aligned on the right


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
    complete_with(runs, paths)
    arguments = parser.parse_args(argv)
    return run_command(lambda: _compare(arguments))


def _compare(arguments: argparse.Namespace) -> int:
    require_no_other_file(Path(arguments.out), b"\x89PNG", "a PNG")
    require_ending("--out", arguments.out, ".png")

    with fast_import():
        from keras_pendulum.compare.figure import draw_comparison
        from keras_pendulum.compare.runs import best_possible, load_runs

    run_folders = _find_runs(arguments.folders)
    with status("Evaluating the runs"):
        runs = load_runs(run_folders)
    write_atomically(arguments.out, draw_comparison(runs, best_possible(runs)))
    score = runs[0].score
    print(
        f"Greedy on {len(score.returns)} fixed starts, "
        f"{score.task.name}: best possible mean return "
        f"{score.optimal_mean_return:.2f}\n\n{_as_markdown(runs)}\n\n"
        f"Learning curves and regrets: {arguments.out}"
    )
    return 0


def _find_runs(names: Sequence[str]) -> list[RunFolder]:
    """Returns the run in each folder.

    Raises UserError for a folder that holds no run, and for one that is given twice.
    """
    from keras_pendulum.storage.run_folder import find_run

    runs = [find_run(name) for name in names]
    first: dict[Path, str] = {}  # names by the real path
    for name, run in zip(names, runs, strict=True):
        if run.weights in first:
            raise UserError(f"{first[run.weights]} and {name} are the same folder: name it once")
        first[run.weights] = name
    return runs


def _as_markdown(runs: Sequence[ComparedRun]) -> str:
    """Returns a table with a row for each run, in aligned columns."""
    columns = []
    for name, *cells in zip(_COLUMNS, *map(_cells, runs), strict=True):
        width = max(map(len, (name, *cells)))
        if name in _NUMBERS:
            line, align = "-" * (width - 1) + ":", str.rjust
        else:
            line, align = "-" * width, str.ljust
        columns.append([align(name, width), line, *(align(cell, width) for cell in cells)])
    return "\n".join(f"| {' | '.join(row)} |" for row in zip(*columns, strict=True))


def _cells(run: ComparedRun) -> list[str]:
    done, wanted = len(run.history), run.config.episodes
    cells = (
        run.name,
        run.config.preset,
        str(run.config.seed),
        str(done) if done >= wanted else f"{done} of {wanted}",
        str(run.history[-1].updates),
        f"{run.score.mean_return:.2f}",
        f"{run.score.regret:.2f}",
        run.changed_settings or "–",
    )
    return [one_line(cell).replace("|", "/") for cell in cells]


if __name__ == "__main__":
    sys.exit(main())
