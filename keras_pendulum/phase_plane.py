"""What a policy of the pendulum does, and what it expects, all over the phase plane (θ, θ̇)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.environment import STEPS_PER_EPISODE
from keras_pendulum.policy import GreedyPolicy
from keras_pendulum.torque import TorqueGrid
from keras_pendulum.value_tables import MAX_SPEED, TORQUES, solve, try_torques, value_at

if TYPE_CHECKING:
    from keras_pendulum.config import Config
    from keras_pendulum.network import DQN

POINTS = 81  # on each axis
_THETA_CELLS = 60  # of the table; a picture shows no finer ones
_THETA = np.linspace(-np.pi, np.pi, POINTS)  # rad, 0 is upright
_SPEED = np.linspace(-MAX_SPEED, MAX_SPEED, POINTS)  # rad/s
EXTENT = (-math.pi, math.pi, -MAX_SPEED, MAX_SPEED)  # θ in rad, θ̇ in rad/s


@dataclass(frozen=True)
class PhasePlane:
    """A policy on a grid: rows are θ̇ from -8 to 8 rad/s, columns θ from -π to π rad."""

    torque: NDArray[np.float64]  # [POINTS, POINTS] N·m, the greedy one
    value: NDArray[np.float64]  # [POINTS, POINTS], the discounted sum of the rewards to come


def beside_optimum(network: DQN, config: Config) -> dict[str, PhasePlane]:
    """A run's policy and the best one for the run's gravity and discount, by name.

    Empty for another environment than the pendulum.
    """
    if config.gravity is None:
        return {}
    return {
        "This policy": of_network(network, config.reward_scale),
        f"Exact optimum for γ = {config.discount:g}": of_optimum(config.gravity, config.discount),
    }


def of_network(network: DQN, reward_scale: float = 1.0) -> PhasePlane:
    """What a network's greedy policy does and expects.

    Args:
        network: of the pendulum.
        reward_scale: the factor on the rewards that it learned from, taken back here.
    """
    policy, grid = GreedyPolicy(network), TorqueGrid(network.action_count)
    torque, value = [], []
    for speed in _SPEED:  # row by row, which takes little memory
        axes = [np.cos(_THETA), np.sin(_THETA), np.full(POINTS, speed)]
        q = policy.q_values(np.stack(axes, axis=1, dtype=np.float32))  # [POINTS, A]
        torque.append(grid.torques[q.argmax(axis=1)])
        value.append(q.max(axis=1) / reward_scale)
    return PhasePlane(np.array(torque), np.array(value))


def of_optimum(gravity: float, discount: float) -> PhasePlane:
    """What the best policy for this discount γ does and expects: the exact solution.

    By dynamic programming (see value_tables.py) over as many steps as still weigh a thousandth,
    an episode at most. A discounted best need not be the best return of an episode.

    Args:
        gravity: m/s².
        discount: γ, 0 to 1.
    """
    horizon = STEPS_PER_EPISODE
    if 0 < discount < 1:
        horizon = min(horizon, math.ceil(math.log(1e-3) / math.log(discount)))
    table = solve(gravity, horizon, _THETA_CELLS, discount)
    torque, value = [], []
    for speed in _SPEED:
        rewards, thetas, speeds = try_torques(gravity, _THETA, np.full(POINTS, speed))
        values = rewards + discount * value_at(table, thetas, speeds)  # [POINTS, A]
        torque.append(TORQUES[values.argmax(axis=1)])
        value.append(values.max(axis=1))
    return PhasePlane(np.array(torque), np.array(value))
