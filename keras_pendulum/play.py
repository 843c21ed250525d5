"""The command `python -m keras_pendulum.play`."""

# PYTHON_ARGCOMPLETE_OK
from __future__ import annotations

import argparse
import functools
import random
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from keras_pendulum.backend import quick_import, require_tensorflow
from keras_pendulum.command_line import ControlC, OneLineParser, name, run_command
from keras_pendulum.config import checked_setting
from keras_pendulum.display import require_display
from keras_pendulum.errors import UserError
from keras_pendulum.lost_window import LossGuard

if TYPE_CHECKING:
    from keras_pendulum.driving import Policy


def main(argv: Sequence[str] | None = None) -> int:
    """Parses the command line and lets the player drive; returns the exit status."""
    parser = OneLineParser(
        prog="python -m keras_pendulum.play",
        description="Drive the pendulum by hand, and see how good a policy drives the same start.",
        epilog="Keys: j or left -2 N·m, l or right +2, k or down 0; r restarts, ESC leaves.",
    )
    parser.add_argument(
        "--gravity", type=float, metavar="G", help="m/s² [what the file records, else 1]"
    )
    parser.add_argument("--seed", type=int, metavar="N", help="of the first start [random]")
    parser.add_argument(
        "--against", type=name, metavar="WEIGHTS.h5", help="a file, or a shipped one by name"
    )
    parser.add_argument("--print-steps", action="store_true", help="print a line for each step")
    arguments = parser.parse_args(argv)
    return run_command(lambda: _play(arguments))


def _play(arguments: argparse.Namespace) -> int:
    gravity, seed = arguments.gravity, arguments.seed
    if gravity is not None:
        gravity = checked_setting("gravity", gravity)
    if seed is not None:
        seed = checked_setting("seed", seed)
    guard = LossGuard()
    require_display()
    agent = None
    if arguments.against is not None:
        agent, recorded = _load_agent(arguments.against)
        gravity = recorded if gravity is None else gravity
    gravity = 1.0 if gravity is None else gravity
    return _drive(guard, gravity, seed, agent, arguments.print_steps)


def _load_agent(weights: str) -> tuple[Policy, float | None]:
    """The policy in a weights file, and the gravity that it records."""
    require_tensorflow()
    with quick_import():
        from keras_pendulum.weights import find_weights, load_weights

    from keras_pendulum.policy import GreedyPolicy
    from keras_pendulum.torque import TorqueGrid

    path = find_weights(weights)
    network = load_weights(path)
    if network.origin.environment != "Pendulum-v1":
        raise UserError(f"{path}: belongs to {network.origin.environment}; expected Pendulum-v1")
    policy, torques = GreedyPolicy(network), TorqueGrid(network.action_count)

    def torque(observation: Any) -> float:
        return float(torques.control(policy.action(observation))[0])

    return torque, network.origin.gravity


def _drive(
    guard: LossGuard, gravity: float, seed: int | None, agent: Policy | None, print_steps: bool
) -> int:
    from keras_pendulum.cockpit import Window, play
    from keras_pendulum.game import Game, Key
    from keras_pendulum.optimum import USUAL_SEEDS

    if seed is None:
        # Of these the best possible returns are known, or kept once they are found.
        seed = random.choice(USUAL_SEEDS)
    tell = functools.partial(print, flush=True)
    game = Game(gravity, seed, agent, tell=tell, print_steps=print_steps)
    guard.before_end = lambda: game.press(Key.LEAVE)
    try:
        with ControlC() as control_c:
            play(game, Window(guard), control_c.check)
    finally:
        game.close()  # and the window with it
    return 0


if __name__ == "__main__":
    sys.exit(main())
