"""The command `python -m keras_pendulum.page`: a weights file as a page to play in a browser.

The page's own text lies in `web/`. Everything goes into one file, the weights as base64 of float32,
so that it needs neither server nor network.
"""

# PYTHON_ARGCOMPLETE_OK
from __future__ import annotations

import argparse
import base64
import json
import math
import os
import re
import sys
import webbrowser
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from keras_pendulum.atomic_file import require_no_other_file, write_atomically
from keras_pendulum.backend import quick_import, require_tensorflow
from keras_pendulum.command_line import OneLineParser, name, run_command
from keras_pendulum.errors import UserError

if TYPE_CHECKING:
    from keras_pendulum.network import DQN

_WEB = Path(__file__).parent / "web"
_HEAD = (
    b"<!doctype html>\n<!-- keras_pendulum page:"  # how a page of ours begins, and no other file
)


def main(argv: Sequence[str] | None = None) -> int:
    """Parses the command line and writes the page; returns the exit status."""
    parser = OneLineParser(
        prog="python -m keras_pendulum.page",
        description="Write a page to play in a browser, driven by the network in a weights file.",
    )
    parser.add_argument("weights", metavar="WEIGHTS.h5", help="a file, or a shipped one by name")
    parser.add_argument(
        "--out", type=name, default="pendulum.html", metavar="FILE", help="[pendulum.html]"
    )
    parser.add_argument(
        "--gravity", type=float, metavar="G", help="m/s² [what the file records, else 1]"
    )
    parser.add_argument("--open", action="store_true", help="open it in the browser, too")
    arguments = parser.parse_args(argv)
    return run_command(lambda: _write(arguments))


def _write(arguments: argparse.Namespace) -> int:
    require_tensorflow()
    out = Path(arguments.out)
    require_no_other_file(out, _HEAD, "a page of ours")
    if arguments.open:
        _require_browser()

    with quick_import():
        from keras_pendulum.weights import find_weights, load_weights

    path = find_weights(arguments.weights)
    page = page_of(load_weights(path), path, arguments.gravity)
    write_atomically(out, page)
    address = out.resolve().as_uri()
    print(f"Wrote {len(page) / 1e6:.2f} MB; open it in a browser: {address}")
    if arguments.open and not webbrowser.open(address):
        raise UserError(f"the browser did not start: open {out} by hand")
    return 0


def page_of(network: DQN, path: Path, gravity: float | None = None) -> bytes:
    """The page as one HTML file, driven by `network`, which was loaded from `path`.

    `gravity` in m/s²; None takes the network's own, or 1 where that is not known. Raises
    ConfigError for one that no run can have, UserError for a network that drives no pendulum.
    """
    from keras_pendulum.config import checked_setting
    from keras_pendulum.environment import TASKS

    origin = network.origin
    if not TASKS[origin.environment].has_torque:
        raise UserError(f"{path}: belongs to {origin.environment}; the page shows Pendulum-v1")
    known = 1.0 if origin.gravity is None else origin.gravity
    weights = b"".join(array.astype("<f4").tobytes() for array in network.get_weights())
    content = {
        "name": path.name,
        "preset": None if origin.preset is None else str(origin.preset),
        "gravity": checked_setting("gravity", known if gravity is None else gravity),
        "trainedGravity": origin.gravity,
        "evaluatedReturn": _evaluated_return(path),
        "sizes": [network.observation_size, *network.hidden_units, network.action_count],
        "activation": network.activation,
        "weights": base64.b64encode(weights).decode(),
    }
    return _filled(content).encode()


def _filled(content: dict[str, Any]) -> str:
    """The page with everything that it refers to put in its place."""

    def text(match: re.Match[str]) -> str:
        return (_WEB / match[1]).read_text(encoding="utf-8")

    page = (_WEB / "pendulum.html").read_text(encoding="utf-8")
    page = re.sub(
        r'<link rel="stylesheet" href="(.+)">', lambda m: f"<style>\n{text(m)}</style>", page
    )
    page = re.sub(r'<script src="(.+)">', lambda m: f"<script>\n{text(m)}", page)
    # A file's name may hold anything, the end of the script too.
    data = json.dumps(content, allow_nan=False).replace("<", r"\u003c")
    return page.replace('id="network">null<', f'id="network">{data}<')


def _evaluated_return(path: Path) -> float | None:
    """What the file records of its own evaluation."""
    from keras_pendulum import layer_files

    with layer_files.opened(path) as file:
        group = file.get("keras_pendulum")
        value = None if group is None else group.attrs.get("evaluated_return")
        return float(value) if value is not None and math.isfinite(value) else None


def _require_browser() -> None:
    screens = ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER")
    if sys.platform == "linux" and not any(map(os.environ.get, screens)):
        # A browser for terminals may be there, but cannot run this page.
        raise UserError("there is no display to open a browser on: leave --open out")
    try:
        webbrowser.get()
    except webbrowser.Error as error:
        raise UserError("there is no browser to open the page with: leave --open out") from error


if __name__ == "__main__":
    sys.exit(main())
