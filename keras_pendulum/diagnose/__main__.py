"""The command `python -m keras_pendulum.diagnose`: what is wrong with an agent."""

# PYTHON_ARGCOMPLETE_OK
from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from keras_pendulum.cli import OneLineParser, nonempty_path, run_command
from keras_pendulum.completion import complete_with, weights_files
from keras_pendulum.storage.atomic_write import require_no_other_file, write_atomically
from keras_pendulum.storage.shipped_weights import shipped_names
from keras_pendulum.tensorflow_setup import fast_import, require_tensorflow


def main(argv: Sequence[str] | None = None, prog: str = "python -m keras_pendulum.diagnose") -> int:
    """Runs the command; returns its exit status."""
    parser = OneLineParser(
        prog=prog,
        description="Compare an agent of the pendulum with the exact solution, and name its fault.",
    )
    agent = parser.add_argument(
        "agent",
        type=nonempty_path,
        metavar="AGENT|RUN_FOLDER",
        help="a weights file, the name of a shipped one, file.py:name, package.module:name, or the "
        "folder of a run, which tells more",
    )
    parser.add_argument(
        "--gravity", type=float, metavar="G", help="gravity in m/s² [recorded in the file, else 1]"
    )
    parser.add_argument(
        "--discount", type=float, metavar="γ", help="discount [recorded in the file, else 0.9]"
    )
    parser.add_argument(
        "--torques",
        type=_torques,
        metavar="U,U,…",
        help="torques of the outputs in N·m; write --torques=-2,… [evenly spaced from -2 to 2]",
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument(
        "--report", type=nonempty_path, metavar="FILE.html", help="save a page with a picture"
    )
    complete_with(agent, weights_files(shipped_names))
    arguments = parser.parse_args(argv)
    return run_command(lambda: _diagnose(arguments))


def _torques(text: str) -> list[float]:
    """Returns the torques of "-2,0,2". Raises ArgumentTypeError for other text."""
    try:
        return [float(word) for word in text.split(",")]
    except ValueError as error:
        raise argparse.ArgumentTypeError(
            f"{text!r} is no list of numbers; expected such as -2,0,2"
        ) from error


def _diagnose(arguments: argparse.Namespace) -> int:
    require_tensorflow()
    if arguments.report:
        require_no_other_file(Path(arguments.report), b"<!DOCTYPE html>", "an HTML file")

    with fast_import():
        from keras_pendulum.diagnose.diagnosis import diagnose
        from keras_pendulum.diagnose.report import as_html
        from keras_pendulum.evaluate.user_code import load_code, names_code

    agent = arguments.agent
    diagnosis = diagnose(
        load_code(agent) if names_code(agent) else agent,
        gravity=arguments.gravity,
        discount=arguments.discount,
        torques=arguments.torques,
    )
    if arguments.report:
        write_atomically(arguments.report, as_html(diagnosis).encode())
    print(json.dumps(diagnosis.as_json()) if arguments.json else diagnosis.summary())
    return 0


if __name__ == "__main__":
    sys.exit(main())
