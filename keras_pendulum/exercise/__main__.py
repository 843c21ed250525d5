"""The command `python -m keras_pendulum.exercise`: find the fault in a DQN program."""

# PYTHON_ARGCOMPLETE_OK
from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from keras_pendulum.cli import OneLineParser, nonempty_path, run_command
from keras_pendulum.completion import complete_with, names, paths
from keras_pendulum.errors import UserError
from keras_pendulum.exercise import class_sets, hints
from keras_pendulum.exercise.program import write_program
from keras_pendulum.exercise.table import EXERCISES

_NOT_HEALTHY = 1  # the exit status


def main(argv: Sequence[str] | None = None, prog: str = "python -m keras_pendulum.exercise") -> int:
    """Runs the command; returns its exit status: 1 for a checked program that is not healthy."""
    parser = OneLineParser(
        prog=prog,
        description="Find the fault in a DQN program: list the exercises, write the program of "
        "one, get a hint, check your repair.",
    )
    number = parser.add_argument(
        "number",
        type=int,
        nargs="?",
        metavar="NUMBER",
        help=f"1 to {max(EXERCISES)}; 0 is the program without a fault; none lists the exercises",
    )
    parser.add_argument(
        "--out",
        type=nonempty_path,
        metavar="FILE|FOLDER",
        help="write the program of the exercise, or the folder of a class",
    )
    checked = parser.add_argument(
        "--check",
        type=nonempty_path,
        metavar="FILE",
        help="train your program, and say whether it is healthy",
    )
    parser.add_argument(
        "--limit",
        type=float,
        default=600.0,
        metavar="SECONDS",
        help="longest time of a check [600]",
    )
    parser.add_argument(
        "--hint",
        type=int,
        nargs="?",
        const=1,
        choices=hints.HINTS,
        metavar="1|2|3",
        help="a question, the finding, or the solution [1]",
    )
    parser.add_argument(
        "--class",
        dest="students",
        type=int,
        metavar="STUDENTS",
        help="write other exercises for each student, and a key for the teacher, to --out",
    )
    parser.add_argument(
        "--each", type=int, default=3, metavar="N", help="exercises of a student of --class [3]"
    )
    parser.add_argument(
        "--seed", type=int, default=0, metavar="N", help="seed of the choice of --class [0]"
    )
    complete_with(number, names(map(str, (0, *EXERCISES))))
    complete_with(checked, lambda prefix, **_: paths(prefix, ".py"))
    arguments = parser.parse_args(argv)
    return run_command(lambda: _run(arguments, prog))


def _run(arguments: argparse.Namespace, prog: str) -> int:
    number, out = arguments.number, arguments.out
    actions = {
        "--class": arguments.students,
        "--hint": arguments.hint,
        "--check": arguments.check,
        "--out": None if arguments.students is not None else out,
    }
    given = [flag for flag, value in actions.items() if value is not None]
    if len(given) > 1:
        raise UserError(f"{given[0]} and {given[1]} do not go together: give one of them")
    if arguments.students is not None:
        if number is not None or out is None:
            raise UserError("--class needs --out FOLDER, and takes no number of an exercise")
        class_sets.write_class(arguments.students, arguments.each, arguments.seed, Path(out))
        print(f"Wrote {arguments.students} folders, and {class_sets.KEY} for the teacher, to {out}")
    elif number is None:
        if given:
            raise UserError(f"{given[0]} needs the number of an exercise, such as 7 {given[0]}")
        print(f"{hints.listing()}\n\nBegin with {prog} 1")
    elif arguments.hint is not None:
        print(hints.hint(number, arguments.hint))
    elif arguments.check is not None:
        return _check(number, Path(arguments.check), arguments.limit)
    elif out is not None:
        write_program(number, Path(out))
        print(f"Wrote {out}")
    else:
        print(hints.task(number, prog))
    return 0


def _check(number: int, path: Path, seconds: float) -> int:
    from keras_pendulum.exercise.check import check

    healthy, text = check(number, path, seconds)
    print(text)
    return 0 if healthy else _NOT_HEALTHY


if __name__ == "__main__":
    sys.exit(main())
