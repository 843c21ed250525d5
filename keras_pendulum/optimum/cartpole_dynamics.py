"""The dynamics of Gymnasium's `CartPole-v1`, for many states at once."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.optimum.known_dynamics import Outcomes

FORCE = 10.0  # N, of a push to the right
FORCES = np.array([-FORCE, FORCE])  # [2], of the actions 0 and 1
LARGEST_POSITION = 2.4  # m
LARGEST_ANGLE = math.radians(12)
TIME_STEP = 0.02  # s
_GRAVITY = 9.8  # m/s²
_POLE, _BOTH = 0.1, 1.1  # kg: the pole's mass, and that of cart and pole
_HALF_LENGTH = 0.5  # m, of the pole

States = NDArray[np.float64]  # [N, 4]: x in m, ẋ in m/s, θ in rad, θ̇ in rad/s


def step_forces(states: States, forces: NDArray[np.float64]) -> Outcomes:
    """Returns the outcomes of one step.

    Args:
        states: [N, 4].
        forces: N, of each action [A], or of each state and action [N, A].
    """
    x, speed, theta, turn = (column[:, None] for column in states.T)  # [N, 1]
    sine, cosine = np.sin(theta), np.cos(theta)
    # The order of the operations is Gymnasium's, so the floating-point rounding is the same.
    thrust = (forces + _POLE * _HALF_LENGTH * np.square(turn) * sine) / _BOTH
    angular = (_GRAVITY * sine - cosine * thrust) / (
        _HALF_LENGTH * (4.0 / 3.0 - _POLE * np.square(cosine) / _BOTH)
    )
    linear = thrust - _POLE * _HALF_LENGTH * angular * cosine / _BOTH
    after = np.stack(
        np.broadcast_arrays(
            x + TIME_STEP * speed,
            speed + TIME_STEP * linear,
            theta + TIME_STEP * turn,
            turn + TIME_STEP * angular,
        ),
        axis=2,
    )
    return Outcomes(np.ones(after.shape[:2]), after, has_fallen(after))


def has_fallen(states: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Returns whether states [..., 4] are beyond ±2.4 m or ±12°."""
    fallen: NDArray[np.bool_] = (np.abs(states[..., 0]) > LARGEST_POSITION) | (
        np.abs(states[..., 2]) > LARGEST_ANGLE
    )
    return fallen
