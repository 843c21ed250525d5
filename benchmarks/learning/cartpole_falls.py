"""From where the networks of CartPole fall although the optimum does not.

    python -m benchmarks.learning.cartpole_falls [STATES]

Draws states (default 4000) uniformly over position ±2.4 m, velocity ±3 m/s, angle ±12° and angular
velocity ±3 rad/s, keeps those from which the exact policy balances the pole for 500 steps, and
plays the shipped networks from there. It takes a minute.
"""

from __future__ import annotations

import sys
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

import keras_pendulum as kp
from benchmarks.result_files import Row, write
from keras_pendulum.dqn.policy import greedy_policy
from keras_pendulum.environments.cartpole import CartPole
from keras_pendulum.optimum.cartpole import CartPoleSolution
from keras_pendulum.optimum.cartpole_dynamics import (
    FORCES,
    LARGEST_POSITION,
    States,
    has_fallen,
    step_forces,
)
from keras_pendulum.optimum.cartpole_values import ENDS

SEED = 7
DISCOUNT = 0.99


def ends(choose: Callable[[States], NDArray[np.float64]], states: States) -> States:
    """Returns the states [N, 4] after 500 steps, or at the end of the episode."""
    states = states.copy()
    standing = np.arange(len(states))
    for _ in range(CartPole.steps_per_episode):
        states[standing] = step_forces(states[standing], choose(states[standing])[:, None]).state[
            :, 0
        ]
        standing = standing[~has_fallen(states[standing])]
    return states


def row(name: str, final: States) -> Row:
    """Returns a row of the table."""
    fallen = has_fallen(final)
    left = np.abs(final[:, 0]) > LARGEST_POSITION
    return {
        "policy": name,
        "states": len(final),
        "balanced for 500 steps": f"{100 * (~fallen).mean():.1f} %",
        "the cart left its track": f"{100 * left.mean():.1f} %",
        "the pole fell": f"{100 * (fallen & ~left).mean():.1f} %",
    }


def main(count: str = "4000") -> None:
    """Plays from the states and writes the table."""
    exact = CartPoleSolution(CartPole())
    table = exact.table(DISCOUNT)

    def optimum(states: States) -> NDArray[np.float64]:
        return FORCES[exact.exact_q(table, DISCOUNT, states, FORCES).argmax(axis=1)]

    states = np.random.default_rng(SEED).uniform(-ENDS, ENDS, (int(count), 4))
    states = states[exact.survives(states)]
    states = states[~has_fallen(ends(optimum, states))]
    rows = []
    for name in ("cartpole-original", "cartpole"):
        policy = greedy_policy(kp.load_weights(name))
        final = ends(
            lambda states, policy=policy: FORCES[  # type: ignore[misc]
                policy.q_values(states.astype(np.float32)).argmax(axis=1)
            ],
            states,
        )
        rows.append(row(f"`{name}`", final))
    write("cartpole_falls", "python -m benchmarks.learning.cartpole_falls", rows)


if __name__ == "__main__":
    main(*sys.argv[1:])
