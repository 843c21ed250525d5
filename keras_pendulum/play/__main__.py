"""The command `python -m keras_pendulum.play`."""

# PYTHON_ARGCOMPLETE_OK
from __future__ import annotations

import argparse
import functools
import random
import sys
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from keras_pendulum.cli import (
    OneLineParser,
    add_activation_flag,
    add_environment_flag,
    nonempty_path,
    run_command,
)
from keras_pendulum.completion import complete_with, weights_files
from keras_pendulum.config.fields import SEED
from keras_pendulum.display import require_display
from keras_pendulum.environments.task import Task
from keras_pendulum.environments.tasks import declared_task
from keras_pendulum.storage.find_weights import find_weights
from keras_pendulum.storage.shipped_weights import shipped_names
from keras_pendulum.tensorflow_setup import fast_import

if TYPE_CHECKING:
    from pathlib import Path

    from keras_pendulum.evaluate.policy import Policy
    from keras_pendulum.play.window import Window


def main(argv: Sequence[str] | None = None, prog: str = "python -m keras_pendulum.play") -> int:
    """Plays the game as the command line says; returns the exit status."""
    parser = OneLineParser(
        prog=prog,
        description="Drive the pendulum or CartPole by hand; --against then shows a policy on the "
        "same start.",
        epilog="Keys of the pendulum: j or right -2 N·m, l or left +2, k, down or up 0. Keys of "
        "CartPole: j or left pushes left, l or right pushes right; with k, down or up the pushes "
        "alternate. h switches between keys that act until the next one and while they are held; "
        "Enter or Space continues, r restarts, ESC leaves.",
    )
    add_environment_flag(parser)
    parser.add_argument(
        "--gravity",
        type=float,
        metavar="G",
        help="gravity in m/s² [recorded in the file, else 10 or 1, where its policy is better; "
        "without a file 1]",
    )
    parser.add_argument("--seed", type=int, metavar="N", help="seed of the first start [random]")
    weights = parser.add_argument(
        "--against",
        type=nonempty_path,
        metavar="WEIGHTS.h5",
        help="a file, the name of a shipped one or a run folder: its policy drives after you",
    )
    add_activation_flag(parser)
    parser.add_argument(
        "--print-steps", action="store_true", help="print a line for each of your steps"
    )
    complete_with(weights, weights_files(shipped_names))
    arguments = parser.parse_args(argv)
    return run_command(lambda: _play(arguments))


def _play(arguments: argparse.Namespace) -> int:
    task = declared_task(arguments.environment or "Pendulum-v1").with_gravity(arguments.gravity)
    seed = arguments.seed
    if seed is not None:
        seed = SEED.validate("seed", seed)
    file = find_weights(arguments.against) if arguments.against is not None else None
    require_display()
    from keras_pendulum.play.window import Window, control_c

    with control_c() as check_control_c:
        window = Window()
        try:
            policy = None
            if file is not None:
                window.show_loading(f"Loading the policy of {file.name} …")
                policy, task = _load_policy(file, arguments)
            return _run_game(window, check_control_c, task, seed, policy, arguments.print_steps)
        finally:
            window.close()


def _load_policy(file: Path, arguments: argparse.Namespace) -> tuple[Policy, Task]:
    """Returns a policy and its task, and prints a line where its gravity had to be found."""
    with fast_import():
        from keras_pendulum.evaluate.evaluation import find_task
        from keras_pendulum.evaluate.sources import load_policy

    environment, gravity = arguments.environment, arguments.gravity
    policy = load_policy(file, arguments.activation)
    if environment:
        policy = policy.with_environment(environment)
    task, assumption = find_task(policy, gravity)
    if assumption and gravity is None:
        print(assumption)
    return policy, task


def _run_game(
    window: Window,
    check_control_c: Callable[[], None],
    task: Task,
    seed: int | None,
    policy: Policy | None,
    print_steps: bool,
) -> int:
    from keras_pendulum.optimum.solution import USUAL_SEEDS
    from keras_pendulum.play.game import Game
    from keras_pendulum.play.window import play

    if seed is None:
        # The optimal returns of these seeds are shipped, or cached after their first use.
        seed = random.choice(USUAL_SEEDS)
    window.show_loading(f"Loading the best possible returns of {task.name} …")
    print_line = functools.partial(print, flush=True)
    game = Game(task, seed, policy, print_line=print_line, print_steps=print_steps)
    try:
        play(game, window, check_control_c)
    finally:
        game.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
