"""Values on a grid that satisfy an equation, right or wrong, as those of a trained network do."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.optimum.dynamics import step_all_torques

Array = NDArray[Any]
TORQUES = np.linspace(-2, 2, 5)
GRAVITY, DISCOUNT = 10.0, 0.9
_ANGLES, _SPEEDS = 120, 81  # of the grid


def _corners(theta: Array, speed: Array) -> tuple[Array, Array]:
    """Returns indices and weights [4, N] of the grid points around states."""
    x = (theta / (2 * np.pi) % 1) * _ANGLES
    y = (np.clip(speed, -8, 8) + 8) / 16 * (_SPEEDS - 1)
    low_x, low_y = x.astype(int) % _ANGLES, np.minimum(y.astype(int), _SPEEDS - 2)
    share_x, share_y = x % 1, y - low_y
    high_x = (low_x + 1) % _ANGLES
    indices = [each * _SPEEDS + low_y + up for each in (low_x, high_x) for up in (0, 1)]
    weights = [a * b for a in (1 - share_x, share_x) for b in (1 - share_y, share_y)]
    return np.array(indices), np.array(weights)


def _at(table: Array, corners: tuple[Array, Array]) -> Array:
    """Returns the rows of a table [grid, A] between grid points: [N, A]."""
    indices, weights = corners
    return np.asarray((table[indices] * weights[..., None]).sum(axis=0))


def right(reward: Array, following: Array, own: Array) -> Array:
    """Returns the targets [N, A] of the right equation."""
    return reward + DISCOUNT * following.max(axis=2)


@cache
def fixed_point(
    target: Callable[[Array, Array, Array], Array], sweeps: int = 120, steps: int = 1
) -> Callable[[Array], Array]:
    """Returns a function from observations [B, 3] to Q-values [B, A].

    Args:
        target: returns the targets [N, A] of rewards [N, A], next values [N, A, A] and own values.
        sweeps: number of times that the targets replace the values.
        steps: of the environment for which each torque acts.
    """
    theta, speed = np.meshgrid(
        2 * np.pi * np.arange(_ANGLES) / _ANGLES, np.linspace(-8, 8, _SPEEDS), indexing="ij"
    )
    reward, next_theta, next_speed = step_all_torques(
        GRAVITY, theta.ravel(), speed.ravel(), TORQUES
    )
    torques = np.tile(TORQUES, len(reward))[:, None]
    for _ in range(steps - 1):
        more, next_theta, next_speed = step_all_torques(
            GRAVITY, next_theta.ravel(), next_speed.ravel(), torques
        )
        reward = reward + more.reshape(reward.shape)
    corners = _corners(next_theta.ravel(), next_speed.ravel())
    q = np.zeros_like(reward)
    for _ in range(sweeps):
        q = target(reward, _at(q, corners).reshape(*reward.shape, -1), q)

    def values(observations: Array) -> Array:
        cosine, sine, speed = observations.astype(float).T
        return _at(q, _corners(np.arctan2(sine, cosine), speed))

    return values
