"""The keys of each task of the game, and their efforts."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.environments.torque import MAX_TORQUE


class Controls(NamedTuple):
    """The controls of a task."""

    keys: str  # the line of the window on the keys
    setting: str  # its line on the physics or on the clock; {gravity} is that of the task
    # Returns the action, as the environment takes it, for the direction of the effort, -1, 0 or 1,
    # and the step of the episode, of which 0 is the first one.
    action: Callable[[int, int], Any]


def _torque(direction: int, step: int) -> NDArray[np.float64]:
    """Returns the torque [1] in N·m."""
    return np.array([MAX_TORQUE * direction])


def _push(direction: int, step: int) -> int:
    """Returns 0 or 1. CartPole has no step without a push: without a key, the pushes alternate."""
    return int(direction > 0) if direction else step % 2


CONTROLS = {  # by environment
    "Pendulum-v1": Controls(
        "l or Left: +2 N·m      k or Down: 0      j or Right: -2 N·m",
        "g = {gravity:g} m/s²",
        _torque,
    ),
    "CartPole-v1": Controls(
        "j or Left: push left      k or Down: alternate      l or Right: push right",
        "slow motion, 20 steps a second",  # a hand is too slow for the real speed
        _push,
    ),
}
