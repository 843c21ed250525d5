"""The states at which a diagnosis compares Q-values, and the episodes that it simulates."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.diagnosis.signals import Array
from keras_pendulum.environments.pendulum import STEPS_PER_EPISODE, Pendulum
from keras_pendulum.environments.torque import MAX_TORQUE
from keras_pendulum.optimum.dynamics import TORQUES, step_all_torques
from keras_pendulum.optimum.value_iteration import value_at

# From observations [B, 3] to torques [B] in N·m.
Act = Callable[[NDArray[np.float32]], Array]

_STATES = 1500  # of each other kind
_VISITED = 200


def observe(states: Array) -> NDArray[np.float32]:
    """Returns the observations [N, 3] of states [N, 2] (θ in rad, θ̇ in rad/s)."""
    theta, speed = states.T
    return np.stack([np.cos(theta), np.sin(theta), speed], axis=1).astype(np.float32)


@dataclass(frozen=True)
class Episodes:
    """Simulated episodes from B starts."""

    states: Array  # [steps, B, 2], θ in rad and θ̇ in rad/s
    rewards: Array  # [steps, B]

    @property
    def returns(self) -> Array:
        """The undiscounted returns [B]."""
        return np.asarray(self.rewards.sum(axis=0))

    def returns_to_go(self, discount: float) -> Array:
        """Returns the discounted sums of the rewards from each step on, [steps, B]."""
        sums = self.rewards.copy()
        for step in range(len(sums) - 2, -1, -1):
            sums[step] += discount * sums[step + 1]
        return sums


def simulate(act: Act, gravity: float, starts: Array) -> Episodes:
    """Returns the episodes of a policy; a torque that is no finite number counts as 0.

    Args:
        act: the policy.
        gravity: m/s².
        starts: [B, 2], θ in rad and θ̇ in rad/s.
    """
    states = np.empty((STEPS_PER_EPISODE, *starts.shape))
    rewards = np.empty(states.shape[:2])
    state = starts
    for step in range(STEPS_PER_EPISODE):
        torque = np.nan_to_num(np.asarray(act(observe(state)), np.float64), posinf=0, neginf=0)
        torque = np.clip(torque, -MAX_TORQUE, MAX_TORQUE)
        reward, theta, speed = step_all_torques(gravity, state[:, 0], state[:, 1], torque[:, None])
        states[step], rewards[step] = state, reward[:, 0]
        state = np.stack([theta[:, 0], speed[:, 0]], axis=1)
    return Episodes(states, rewards)


def visited_states(q_values: Act, torques: Array, gravity: float, starts: Array) -> Array:
    """Returns 200 states [N, 2] that a network visits, with 10 to 100 % of random torques.

    Args:
        q_values: from observations [B, 3] to Q-values [B, A].
        torques: N·m of the outputs, [A].
        gravity: m/s².
        starts: [B, 2].
    """
    random = np.random.RandomState(2)

    def act(observations: NDArray[np.float32]) -> Array:
        greedy = q_values(observations).argmax(axis=1)
        explore = random.random_sample(len(greedy)) < epsilon
        return torques[np.where(explore, random.randint(len(torques), size=len(greedy)), greedy)]

    epsilon = np.linspace(0.1, 1, len(starts))[random.permutation(len(starts))]
    states = simulate(act, gravity, starts).states.reshape(-1, 2)
    return states[random.permutation(len(states))[:_VISITED]]


def training_states(
    table: NDArray[np.float32], gravity: float, discount: float, starts: Array
) -> Array:
    """Returns states [N, 2] that a run meets: the exact policy with many random torques.

    Args:
        table: exact V of the task.
        gravity: m/s².
        discount: γ.
        starts: [B, 2].
    """
    random = np.random.RandomState(1)

    def act(observation: NDArray[np.float32]) -> Array:
        theta = np.arctan2(observation[:, 1], observation[:, 0]).astype(np.float64)
        speed = observation[:, 2].astype(np.float64)
        reward, next_theta, next_speed = step_all_torques(gravity, theta, speed)
        greedy = (reward + discount * value_at(table, next_theta, next_speed)).argmax(axis=1)
        explore = random.random_sample(len(theta)) < epsilon
        indices = np.where(explore, random.randint(len(TORQUES), size=len(theta)), greedy)
        return np.asarray(TORQUES[indices])

    epsilon = np.linspace(0.1, 1, len(starts))[random.permutation(len(starts))]
    states = simulate(act, gravity, starts).states.reshape(-1, 2)
    return states[random.permutation(len(states))[:_STATES]]


def _observation_changes() -> dict[str, NDArray[np.float32]]:
    names, identity = Pendulum.observation_names, np.eye(3, dtype=np.float32)
    changes = {}
    for order in permutations(range(3)):
        for signs in product((1, -1), repeat=3):
            name = ", ".join(
                ("-" if sign < 0 else "") + names[i] for i, sign in zip(order, signs, strict=True)
            )
            changes[name] = identity[:, list(order)] * np.array(signs, np.float32)
    # Both signs turned is the reversed torque: the pendulum is symmetric.
    for name in ("cos θ, sin θ, θ̇", "cos θ, -sin θ, -θ̇"):
        del changes[name]
    for name, factor in (("θ̇·π/180", np.pi / 180), ("θ̇·180/π", 180 / np.pi), ("θ̇/8", 1 / 8)):
        changes[f"cos θ, sin θ, {name}"] = np.diag(np.array([1, 1, factor], np.float32))
    return changes


# Matrices [3, 3] that undo a wrong order, sign or unit of the observation, by name.
OBSERVATION_CHANGES = _observation_changes()
