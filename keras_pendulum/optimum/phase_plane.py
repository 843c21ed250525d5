"""Phase planes: the greedy torque and the value of a policy over θ and θ̇ of the pendulum."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.dqn.policy import greedy_policy
from keras_pendulum.environments.actions import TorqueGrid
from keras_pendulum.environments.pendulum import MAX_SPEED, STEPS_PER_EPISODE, Pendulum
from keras_pendulum.optimum.discounted import exact_q
from keras_pendulum.optimum.dynamics import TORQUES
from keras_pendulum.optimum.value_iteration import solve

if TYPE_CHECKING:
    from keras_pendulum.config.config import Config
    from keras_pendulum.dqn.network import DQN

POINTS = 81  # on each axis
_THETA_CELLS = 60  # of the table; a finer one makes no visible difference
_THETA = np.linspace(-np.pi, np.pi, POINTS)  # rad, 0 is upright
_SPEED = np.linspace(-MAX_SPEED, MAX_SPEED, POINTS)  # rad/s
EXTENT = (-math.pi, math.pi, -MAX_SPEED, MAX_SPEED)  # θ in rad, θ̇ in rad/s


@dataclass(frozen=True)
class PhasePlane:
    """A policy on a grid: rows are θ̇ from -8 to 8 rad/s, columns θ from -π to π rad."""

    torque: NDArray[np.float64]  # [POINTS, POINTS] N·m, of the greedy action
    value: NDArray[np.float64]  # [POINTS, POINTS], discounted sum of the future rewards


def run_phase_planes(network: DQN, config: Config) -> dict[str, PhasePlane]:
    """Returns the phase planes of a run's network and of its optimum, by name.

    The optimum is that of the run's gravity and discount. The result is empty for another task than
    the pendulum.
    """
    task = config.task
    if not isinstance(task, Pendulum):
        return {}
    return {
        "This policy": network_phase_plane(network, config.reward_scale),
        f"Exact optimum for γ = {config.discount:g}": optimal_phase_plane(
            task.gravity, config.discount
        ),
    }


def network_phase_plane(network: DQN, reward_scale: float = 1.0) -> PhasePlane:
    """Returns the greedy torques of a Q-network, and its values divided by the `reward_scale`."""
    policy, columns = greedy_policy(network), [np.cos(_THETA), np.sin(_THETA)]
    rows = [
        policy.q_values(np.stack([*columns, np.full(POINTS, speed)], axis=1, dtype=np.float32))
        for speed in _SPEED  # one row at a time, which needs little memory
    ]
    return _phase_plane(rows, TorqueGrid(network.action_count).torques, reward_scale)


def optimal_phase_plane(gravity: float, discount: float) -> PhasePlane:
    """Returns the greedy torques and the values of the optimal policy for a discount.

    They are computed by `value_iteration` over the steps whose discount factor is above 0.001, at
    most an episode. The policy for a discount below 1 need not attain the highest return.
    """
    horizon = STEPS_PER_EPISODE
    if 0 < discount < 1:
        horizon = min(horizon, math.ceil(math.log(1e-3) / math.log(discount)))
    table = solve(gravity, horizon, _THETA_CELLS, discount)
    rows = [exact_q(table, gravity, discount, _THETA, np.full(POINTS, speed)) for speed in _SPEED]
    return _phase_plane(rows, TORQUES)


def _phase_plane(
    rows: list[NDArray[Any]], torques: NDArray[np.float64], reward_scale: float = 1.0
) -> PhasePlane:
    """Returns the phase plane of Q-values: one [POINTS, A] for each speed."""
    torque = np.array([torques[q.argmax(axis=1)] for q in rows])
    return PhasePlane(torque, np.array([q.max(axis=1) / reward_scale for q in rows]))
