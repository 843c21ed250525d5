"""The command `python -m keras_pendulum.evaluate`."""

# PYTHON_ARGCOMPLETE_OK
from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from typing import Any

from keras_pendulum.cli import OneLineParser, add_activation_flag, run_command
from keras_pendulum.completion import complete_with, weights_files
from keras_pendulum.display import require_display
from keras_pendulum.errors import UserError
from keras_pendulum.evaluate.film_command import add_film_flags, make_films, require_film_files
from keras_pendulum.storage.shipped_weights import shipped_names
from keras_pendulum.tensorflow_setup import fast_import, require_tensorflow


def main(argv: Sequence[str] | None = None, prog: str = "python -m keras_pendulum.evaluate") -> int:
    """Runs the command; returns its exit status."""
    parser = OneLineParser(
        prog=prog,
        description="Evaluate the policy in a weights file and compare it with the best possible "
        "return.",
    )
    weights = parser.add_argument(
        "weights", metavar="WEIGHTS.h5", help="a file, or the name of a shipped one"
    )
    parser.add_argument(
        "--episodes", type=int, default=100, metavar="N", help="number of episodes [100]"
    )
    parser.add_argument(
        "--seed",
        type=int,
        default=0,
        metavar="N",
        help="seed of the first start; episode i starts from seed N + i [0]",
    )
    parser.add_argument(
        "--gravity", type=float, metavar="G", help="gravity in m/s² [recorded in the file, else 1]"
    )
    add_activation_flag(parser)
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--render", action="store_true", help="show the episodes in a window")
    add_film_flags(parser)
    complete_with(weights, weights_files(shipped_names))
    arguments = parser.parse_args(argv)
    return run_command(lambda: _evaluate(arguments))


def _evaluate(arguments: argparse.Namespace) -> int:
    require_tensorflow()
    require_film_files(arguments)
    if arguments.render:
        require_display()

    with fast_import():
        from keras_pendulum.evaluate.evaluation import evaluate_policy
        from keras_pendulum.evaluate.loaded_policy import Policy
        from keras_pendulum.storage.find_weights import find_weights
        from keras_pendulum.storage.weights import load_weights

    def require_open_window(env: Any) -> None:
        if arguments.render and _window_closed():  # Gymnasium ignores a closed window
            raise UserError("the window was closed before the end of the last episode")

    path = find_weights(arguments.weights)
    network = load_weights(path, arguments.activation)
    score = evaluate_policy(
        network,
        arguments.episodes,
        arguments.seed,
        gravity=arguments.gravity,
        render_mode="human" if arguments.render else None,
        on_step=require_open_window,
    )
    if arguments.gif or arguments.video:
        make_films(arguments, Policy(network), score.environment, score.gravity, path.stem)
    if arguments.json:
        print(json.dumps({"weights": str(path), **score.as_json()}))
    else:
        print(score.summary())
    return 0


def _window_closed() -> bool:
    """Returns whether the user has closed the window since the last call."""
    import pygame

    return bool(pygame.event.get(pygame.QUIT))


if __name__ == "__main__":
    sys.exit(main())
