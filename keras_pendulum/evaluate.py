"""The command `python -m keras_pendulum.evaluate`."""

# PYTHON_ARGCOMPLETE_OK
from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from keras_pendulum.atomic_file import require_no_other_file, write_atomically
from keras_pendulum.backend import quick_import, require_tensorflow
from keras_pendulum.command_line import OneLineParser, name, run_command
from keras_pendulum.display import draw_without_display, require_display
from keras_pendulum.environment import TASKS
from keras_pendulum.errors import UserError
from keras_pendulum.lost_window import LossGuard

if TYPE_CHECKING:
    from keras_pendulum.network import DQN


def main(argv: Sequence[str] | None = None) -> int:
    """Parses the command line and evaluates; returns the exit status."""
    parser = OneLineParser(
        prog="python -m keras_pendulum.evaluate",
        description="Tell how good the policy in a weights file is, beside the best possible one.",
    )
    parser.add_argument("weights", metavar="WEIGHTS.h5", help="a file, or a shipped one by name")
    parser.add_argument("--episodes", type=int, default=100, metavar="N", help="how many [100]")
    parser.add_argument(
        "--seed", type=int, default=0, metavar="N", help="of the first start; i is added [0]"
    )
    parser.add_argument(
        "--gravity", type=float, metavar="G", help="m/s² [what the file records, else 1]"
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object instead")
    parser.add_argument("--render", action="store_true", help="show the episodes in a window")
    parser.add_argument("--gif", type=name, metavar="FILE", help="film the first episode")
    arguments = parser.parse_args(argv)
    return run_command(lambda: _evaluate(arguments))


def _evaluate(arguments: argparse.Namespace) -> int:
    require_tensorflow()
    if arguments.gif:
        require_no_other_file(Path(arguments.gif), b"GIF8", "a GIF")
    guard = LossGuard() if arguments.render else None
    if arguments.render:
        require_display()

    with quick_import():
        from keras_pendulum.evaluation import evaluate_policy
        from keras_pendulum.weights import find_weights, load_weights

    def watch(env: Any) -> None:
        if guard and guard.closed():  # Gymnasium would go on without it
            raise UserError("the window was closed before the last episode was over")

    path = find_weights(arguments.weights)
    network = load_weights(path)
    score = evaluate_policy(
        network,
        arguments.episodes,
        arguments.seed,
        gravity=arguments.gravity,
        render_mode="human" if arguments.render else None,
        on_step=watch,
    )
    if arguments.gif:
        _film(network, arguments.seed, score.gravity, arguments.gif)
    if arguments.json:
        print(json.dumps({"weights": str(path), **score.as_json()}))
    else:
        print(score.summary())
    return 0


def _film(network: DQN, seed: int, gravity: float | None, path: str) -> None:
    """Writes a GIF of the first episode at its own speed, ten frames a second."""
    from keras_pendulum import pictures
    from keras_pendulum.evaluation import evaluate_policy

    draw_without_display()
    frames: list[Any] = []
    evaluate_policy(
        network,
        1,
        seed,
        gravity=gravity,
        render_mode="rgb_array",
        on_step=lambda env: frames.append(env.render()),
    )
    apart = round(0.1 / TASKS[network.origin.environment].seconds_per_step)
    write_atomically(path, pictures.gif(frames[::apart], seconds_per_frame=0.1))


if __name__ == "__main__":
    sys.exit(main())
