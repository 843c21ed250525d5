"""Phase planes: the greedy effort and the value of a policy over θ and θ̇.

The cart of CartPole is at rest in the middle of its track.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.dqn.policy import greedy_policy
from keras_pendulum.environments.pendulum import STEPS_PER_EPISODE, Pendulum
from keras_pendulum.optimum.known_dynamics import KnownDynamics, Table
from keras_pendulum.optimum.solutions import known_dynamics, solution
from keras_pendulum.optimum.value_iteration import solve

if TYPE_CHECKING:
    from keras_pendulum.config.config import Config
    from keras_pendulum.dqn.network import DQN
    from keras_pendulum.environments.task import Task

POINTS = 81  # on each axis
_THETA_CELLS = 60  # of the pendulum's table; a finer one makes no visible difference


@dataclass(frozen=True)
class PhasePlane:
    """A policy on a grid: rows are θ̇ and columns θ, from the lowest to the highest."""

    effort: NDArray[np.float64]  # [POINTS, POINTS], of the greedy action; 0 also where all is lost
    value: NDArray[np.float64]  # [POINTS, POINTS], discounted sum of the future rewards
    dynamics: KnownDynamics


def run_phase_planes(network: DQN, config: Config) -> dict[str, PhasePlane]:
    """Returns the phase planes of a run's network and of its optimum, by name.

    The optimum is that of the run's task and discount. The result is empty for a task whose
    dynamics are not known.
    """
    if not isinstance(solution(config.task), KnownDynamics):
        return {}
    return {
        "This policy": network_phase_plane(network, config.task, config.reward_scale),
        f"Exact optimum for γ = {config.discount:g}": optimal_phase_plane(
            config.task, config.discount
        ),
    }


def network_phase_plane(network: DQN, task: Task, reward_scale: float = 1.0) -> PhasePlane:
    """Returns the greedy efforts of a Q-network, and its values divided by the `reward_scale`."""
    dynamics, policy = known_dynamics(task), greedy_policy(network)
    efforts = dynamics.efforts(task.actions(network.action_count).values)
    # One row at a time, which needs little memory.
    q = np.array([policy.q_values(dynamics.observe(row)) for row in _rows(dynamics)])
    return PhasePlane(efforts[q.argmax(axis=2)], q.max(axis=2) / reward_scale, dynamics)


def optimal_phase_plane(task: Task, discount: float) -> PhasePlane:
    """Returns the greedy efforts and the values of the optimal policy for a discount.

    The policy for a discount below 1 need not attain the highest return.
    """
    dynamics = known_dynamics(task)
    efforts, rows = dynamics.efforts(task.actions().values), _rows(dynamics)
    if isinstance(task, Pendulum):
        table = _coarse_table(task, discount)
    else:
        table = dynamics.table(discount)
    q = np.array([dynamics.exact_q(table, discount, row, efforts) for row in rows])
    survives = np.array([dynamics.survives(row) for row in rows])
    return PhasePlane(np.where(survives, efforts[q.argmax(axis=2)], 0.0), q.max(axis=2), dynamics)


def _coarse_table(task: Pendulum, discount: float) -> Table:
    """Returns a coarse table of V, which takes little time.

    It counts the steps whose discount factor is above 0.001, at most an episode.
    """
    horizon = STEPS_PER_EPISODE
    if 0 < discount < 1:
        horizon = min(horizon, math.ceil(math.log(1e-3) / math.log(discount)))
    return solve(task.gravity, horizon, _THETA_CELLS, discount)


def _rows(dynamics: KnownDynamics) -> NDArray[np.float64]:
    """Returns the states [POINTS, POINTS, S]. θ and θ̇ are the last two numbers; others are 0."""
    angles, speeds = (np.linspace(-end, end, POINTS) for end in dynamics.phase_ends)
    states = np.zeros((POINTS, POINTS, len(dynamics.task.starts(range(1))[0])))
    states[..., -2], states[..., -1] = angles, speeds[:, None]
    return states
