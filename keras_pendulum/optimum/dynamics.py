"""The dynamics of Gymnasium's `Pendulum-v1`, for many states and all 41 torques at once."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.environments.actions import TorqueGrid
from keras_pendulum.environments.pendulum import MAX_SPEED

TIME_STEP = 0.05  # s
TORQUES = TorqueGrid().torques  # [41] N·m

ByTorque = NDArray[np.float64]  # [N, 41]: one value for each of N states and each torque


def simulate_return(
    choose_torques: Callable[[int, ByTorque, ByTorque, ByTorque], NDArray[Any]],
    steps: int,
    gravity: float,
    starts: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Returns the undiscounted returns [N] of episodes from `starts` [N, 2] (θ, θ̇).

    `choose_torques` returns the torques' indices [N]. Its arguments are the number of the step,
    from 0, and the three results of `step_all_torques` for that step.
    """
    theta, speed = starts.T  # [N]
    returns = np.zeros(len(starts))
    rows = np.arange(len(starts))
    for step in range(steps):
        rewards, next_theta, next_speed = step_all_torques(gravity, theta, speed)
        torque_index = choose_torques(step, rewards, next_theta, next_speed)  # [N]
        returns += rewards[rows, torque_index]
        theta, speed = next_theta[rows, torque_index], next_speed[rows, torque_index]
    return returns


def step_all_torques(
    gravity: float,
    theta: NDArray[np.float64],
    speed: NDArray[np.float64],
    torques: NDArray[np.float64] = TORQUES,
) -> tuple[ByTorque, ByTorque, ByTorque]:
    """Returns the rewards, the next θ and the next θ̇, each [N, A], of one step.

    Args:
        gravity: g in m/s².
        theta: [N] rad, any angle.
        speed: [N] rad/s, -8 to 8.
        torques: N·m, -2 to 2, [A] or [N, A].
    """
    # The order of the operations is Gymnasium's, so the floating-point rounding is the same.
    gravity_term = 3 * gravity / 2 * np.sin(theta)  # [N] rad/s²
    next_speed = speed[:, None] + (gravity_term[:, None] + 3 * torques) * TIME_STEP
    next_speed = np.clip(next_speed, -MAX_SPEED, MAX_SPEED)
    angle = (theta + np.pi) % (2 * np.pi) - np.pi  # [N], -π to π
    cost = (angle**2 + 0.1 * speed**2)[:, None] + 0.001 * torques**2
    return -cost, theta[:, None] + next_speed * TIME_STEP, next_speed
