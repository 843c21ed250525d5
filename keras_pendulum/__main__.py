"""The command `keras-pendulum`: lists the commands, presets and shipped weights, or runs a command.

`python -m keras_pendulum COMMAND …` and `keras-pendulum COMMAND …` equal
`python -m keras_pendulum.COMMAND …`.
"""

# PYTHON_ARGCOMPLETE_OK
from __future__ import annotations

import argparse
import importlib
import os
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path

from keras_pendulum.cli import OneLineParser, run_command
from keras_pendulum.completion import complete_with, completes, names
from keras_pendulum.config.presets import DESCRIPTIONS, PRESETS
from keras_pendulum.errors import did_you_mean
from keras_pendulum.storage.shipped_weights import shipped_returns
from keras_pendulum.version import __version__

COMMANDS = {
    "train": "train a DQN, and evaluate it",
    "evaluate": "evaluate a policy, and compare it with the best possible return",
    "diagnose": "name what is wrong with an agent",
    "play": "drive the pendulum by hand, then watch a policy from the same start",
    "page": "write a page for the browser that shows a policy",
    "compare": "draw the learning curves and regrets of several runs",
    "exercise": "find the fault in a DQN program",
    "study": "train variants with many seeds, and compare their regrets",
}


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the command that the first word names; without one, lists what there is."""
    words = list(sys.argv[1:] if argv is None else argv)
    # What the user typed: Python itself runs this file, or a script of pip imports it.
    as_module = Path(sys.argv[0]).name == "__main__.py"
    prog = "python -m keras_pendulum" if as_module else "keras-pendulum"
    if completes():
        words = _words_before_cursor()
    if words and words[0] in COMMANDS:
        command = importlib.import_module(f"keras_pendulum.{room(words[0])}.__main__")
        status: int = command.main(words[1:], f"{prog} {words[0]}")
        return status
    return run_command(lambda: _list(prog, words))


def room(command: str) -> str:
    """Returns the room of a command; `diagnose` is a function of the package as well."""
    return "diagnosis" if command == "diagnose" else command


def _list(prog: str, words: Sequence[str]) -> int:
    """Prints the commands, presets and shipped weights, or the version."""
    parser = OneLineParser(
        prog=prog,
        usage="%(prog)s [COMMAND …]",
        description=_description(prog),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    command = parser.add_argument("command", nargs="?", help=argparse.SUPPRESS)
    parser.add_argument(
        "--version",
        action="version",
        version=f"keras_pendulum {__version__}",
        help="show the version and exit",
    )
    complete_with(command, names(COMMANDS))
    if words and not words[0].startswith("-"):
        parser.error(
            f"unknown command {words[0]!r}; expected one of {', '.join(COMMANDS)}"
            f"{did_you_mean(words[0], [*COMMANDS, '--help', '--version'])}"
        )
    parser.parse_args(words)
    parser.print_help()
    return 0


def _description(prog: str) -> str:
    tasks = {name: preset.task.name for name, preset in PRESETS.items()}
    sections = {
        f"commands ({prog} COMMAND --help shows the flags of one):": COMMANDS.items(),
        "presets (train --preset NAME):": [
            (name, task, DESCRIPTIONS[name]) for name, task in tasks.items()
        ],
        "shipped weights (evaluate NAME), mean return on 100 fixed starts:": [
            (name, tasks[name], f"{mean_return:8.2f}")
            for name, mean_return in shipped_returns().items()
        ],
    }
    return "\n\n".join(
        [
            f"keras_pendulum {__version__}: a DQN for the inverted pendulum in Keras.",
            *(f"{title}\n{_aligned(rows)}" for title, rows in sections.items()),
        ]
    )


def _aligned(rows: Iterable[tuple[str, ...]]) -> str:
    """Returns the rows as lines with aligned columns."""
    lines = list(rows)
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    return "\n".join(f"  {'  '.join(map(str.ljust, line, widths))}".rstrip() for line in lines)


def _words_before_cursor() -> list[str]:
    """Returns the finished words of the line that a shell completes, from the command's name on.

    If there are any, argcomplete takes the name for a part of the program's.
    """
    from argcomplete.lexers import split_line

    line, cursor = os.environ["COMP_LINE"], int(os.environ["COMP_POINT"])
    program_words = int(os.environ["_ARGCOMPLETE"])
    *_, finished, _ = split_line(line, cursor)
    words: list[str] = finished[program_words:]
    if words:
        os.environ["_ARGCOMPLETE"] = str(program_words + 1)
    return words


if __name__ == "__main__":
    sys.exit(main())
