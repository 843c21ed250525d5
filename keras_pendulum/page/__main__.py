"""The command `python -m keras_pendulum.page`: writes a page that runs in a browser."""

# PYTHON_ARGCOMPLETE_OK
from __future__ import annotations

import argparse
import os
import sys
import webbrowser
from collections.abc import Sequence
from pathlib import Path

from keras_pendulum.cli import OneLineParser, add_activation_flag, nonempty_path, run_command
from keras_pendulum.completion import complete_with, weights_files
from keras_pendulum.errors import UserError
from keras_pendulum.status import status
from keras_pendulum.storage.atomic_write import require_no_other_file, write_atomically
from keras_pendulum.storage.shipped_weights import shipped_names
from keras_pendulum.tensorflow_setup import fast_import

_HEAD = b"<!doctype html>\n<!-- keras_pendulum page:"  # the first bytes of every page


def main(argv: Sequence[str] | None = None, prog: str = "python -m keras_pendulum.page") -> int:
    """Writes the page as the command line says; returns the exit status."""
    parser = OneLineParser(
        prog=prog,
        description="Write a page that runs in a browser and shows the network of a weights file. "
        "The page of a run with snapshots (train --snapshots N) shows how the network learned.",
    )
    weights = parser.add_argument(
        "weights",
        metavar="WEIGHTS.h5|RUN_FOLDER",
        nargs="?",
        help="a file, the name of a shipped one, or the folder of a run",
    )
    against = parser.add_argument(
        "--against",
        metavar="WEIGHTS.h5|RUN_FOLDER",
        help="a second network, shown beside the first",
    )
    parser.add_argument(
        "--out",
        type=nonempty_path,
        metavar="FILE",
        help="file of the page [pendulum.html, cartpole.html or lesson.html]",
    )
    parser.add_argument(
        "--lesson",
        action="store_true",
        help="write a lesson in five scenes on `reference` and `original`",
    )
    parser.add_argument(
        "--gravity",
        type=float,
        metavar="G",
        help="of the pendulum, in m/s² [recorded in the file, else the better one of 10 and 1]",
    )
    add_activation_flag(parser)
    parser.add_argument("--open", action="store_true", help="open the page in the browser")
    complete_with(weights, weights_files(shipped_names))
    complete_with(against, weights_files(shipped_names))
    arguments = parser.parse_args(argv)
    if arguments.lesson:
        given = [arguments.weights, arguments.against, arguments.gravity, arguments.activation]
        if any(each is not None for each in given):
            parser.error(
                "--lesson shows `reference` and `original`: it takes only --out and --open"
            )
        arguments.weights, arguments.against = "reference", "original"
        arguments.out = arguments.out or "lesson.html"
    elif arguments.weights is None:
        parser.error("the following arguments are required: WEIGHTS.h5|RUN_FOLDER")
    return run_command(lambda: _write(arguments))


def _write(arguments: argparse.Namespace) -> int:
    if arguments.open:
        _require_browser()

    with fast_import():
        from keras_pendulum.evaluate.evaluation import find_task
        from keras_pendulum.evaluate.sources import load_policy
        from keras_pendulum.page.build import FOLDERS, build_page
        from keras_pendulum.page.training import training_content
        from keras_pendulum.storage.find_weights import find_weights
        from keras_pendulum.storage.load_weights import load_weights
        from keras_pendulum.storage.run_folder import find_run_if_folder

    run = find_run_if_folder(arguments.weights)
    path = run.weights if run else find_weights(arguments.weights)
    network, against = load_weights(path, arguments.activation), None
    training = training_content(run, network) if run else None
    name = path.resolve().parent.name if run else None
    if arguments.against is not None:
        other = find_weights(arguments.against)  # also the folder of a run
        against = (load_weights(other), other)
    task, assumption = find_task(load_policy(network), arguments.gravity)
    out = Path(arguments.out or f"{FOLDERS[task.environment]}.html")
    require_no_other_file(out, _HEAD, "a page of this command")
    if assumption and arguments.gravity is None:
        print(assumption)
    with status("Computing the optimum for the page"):
        page = build_page(network, path, task, against, training, name, arguments.lesson)
    write_atomically(out, page)
    address = out.resolve().as_uri()
    print(f"Wrote {len(page) / 1e6:.2f} MB; open it in a browser: {address}")
    if run and not training:
        print("There is no slider: the run has no snapshots (train --snapshots 20 keeps them)")
    if arguments.open and not webbrowser.open(address):
        raise UserError(f"the browser did not start: open {out} yourself")
    return 0


def _require_browser() -> None:
    screens = ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER")
    if sys.platform == "linux" and not any(map(os.environ.get, screens)):
        # A text browser cannot run this page.
        raise UserError("there is no display for a browser: leave out --open")
    try:
        webbrowser.get()
    except webbrowser.Error as error:
        raise UserError("there is no browser: leave out --open") from error


if __name__ == "__main__":
    sys.exit(main())
