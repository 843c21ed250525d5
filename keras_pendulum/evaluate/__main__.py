"""The command `python -m keras_pendulum.evaluate`."""

# PYTHON_ARGCOMPLETE_OK
from __future__ import annotations

import argparse
import contextlib
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from keras_pendulum.cli import (
    OneLineParser,
    add_activation_flag,
    add_environment_flag,
    add_torques_flag,
    print_json,
    prints_to_stderr,
    run_command,
)
from keras_pendulum.completion import complete_with, weights_files
from keras_pendulum.errors import UserError
from keras_pendulum.evaluate.film_command import add_film_flags, make_films, require_film_files
from keras_pendulum.status import status
from keras_pendulum.storage.shipped_weights import shipped_names
from keras_pendulum.tensorflow_setup import fast_import


def main(argv: Sequence[str] | None = None, prog: str = "python -m keras_pendulum.evaluate") -> int:
    """Runs the command; returns its exit status."""
    parser = OneLineParser(
        prog=prog,
        description="Evaluate a policy and compare it with the best possible return.",
    )
    agent = parser.add_argument(
        "agent",
        metavar="AGENT",
        help="a weights file (.h5, .keras), the name of a shipped one, or an agent in your own "
        "code, which is run: file.py:name or package.module:name (docs/agents.md)",
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
    add_environment_flag(parser)
    parser.add_argument(
        "--gravity",
        type=float,
        metavar="G",
        help="gravity in m/s² [recorded in the file, else the better one of 10 and 1]",
    )
    parser.add_argument(
        "--discount",
        type=float,
        metavar="γ",
        help="discount that the policy learned with; the score then says what the discount alone "
        "costs [recorded in the file]",
    )
    add_torques_flag(parser)
    add_activation_flag(parser)
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--render", action="store_true", help="show the episodes in a window")
    add_film_flags(parser)
    complete_with(agent, weights_files(shipped_names))
    arguments = parser.parse_args(argv)
    return run_command(lambda: _evaluate(arguments))


def _evaluate(arguments: argparse.Namespace) -> int:
    require_film_files(arguments)

    with fast_import():
        from keras_pendulum.evaluate.evaluation import evaluate_policy
        from keras_pendulum.evaluate.named_policy import named_policy

    def require_open_window(env: Any) -> None:
        import pygame

        if pygame.event.get(pygame.QUIT):  # Gymnasium ignores a closed window
            raise UserError("the window was closed before the end of the last episode")

    with prints_to_stderr() if arguments.json else contextlib.nullcontext():
        policy = named_policy(
            arguments.agent, arguments.torques, arguments.activation, arguments.environment
        )
        with status("Evaluating") as report:
            score = evaluate_policy(
                policy,
                arguments.episodes,
                arguments.seed,
                gravity=arguments.gravity,
                discount=arguments.discount,
                render_mode="human" if arguments.render else None,
                on_step=require_open_window if arguments.render else None,
                on_progress=report,
            )
        if arguments.gif or arguments.video:
            shown = Path(policy.name).stem if Path(policy.name).is_file() else policy.name
            make_films(arguments, policy, score.task, shown)
    if arguments.json:
        print_json({"weights": policy.name, **score.as_json()})
    else:
        print(score.summary())
    return 0


if __name__ == "__main__":
    sys.exit(main())
