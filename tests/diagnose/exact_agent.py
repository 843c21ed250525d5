"""Agents whose Q-values are the exact ones, and their diagnosis without a computed table."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.diagnose.other_tasks import other_value
from keras_pendulum.diagnose.subject import Subject
from keras_pendulum.optimum.discounted import exact_q
from keras_pendulum.optimum.dynamics import TORQUES

coarse_value = cache(other_value)


def exact_values(
    observations: NDArray[np.float32], gravity: float = 1.0, discount: float = 0.9
) -> NDArray[np.float64]:
    """Returns the exact Q-values [B, 41] of observations [B, 3]."""
    theta = np.arctan2(observations[:, 1], observations[:, 0]).astype(np.float64)
    speed = np.clip(observations[:, 2].astype(np.float64), -8, 8)
    return exact_q(coarse_value(gravity, discount), gravity, discount, theta, speed)


def subject(q_values: Any, gravity: float = 1.0, discount: float = 0.9) -> Subject:
    """Returns the greedy agent of a function from observations [B, 3] to Q-values [B, 41]."""

    def act(observations: NDArray[np.float32]) -> NDArray[np.float64]:
        return np.asarray(TORQUES[q_values(observations).argmax(axis=1)])

    return Subject("agent", gravity, discount, act, q_values, TORQUES)
