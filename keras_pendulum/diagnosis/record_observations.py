"""Finds the observation that a record has in another order, sign or unit, and undoes the change."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.diagnosis.motions import motion_kind
from keras_pendulum.diagnosis.states import observation_changes
from keras_pendulum.errors import ConfigError
from keras_pendulum.optimum.known_dynamics import KnownDynamics

_ROWS = 5000

Observations = NDArray[Any]


def find_change(
    dynamics: KnownDynamics,
    before: Observations,
    action: NDArray[Any],
    after: Observations,
    name: str,
) -> NDArray[np.float32]:
    """Returns the matrix [D, D] with which the observations are those of the task.

    It is the identity where the observations are right, and where no change makes them obey the
    dynamics.

    Args:
        dynamics: the task.
        before: observations [N, D], float32.
        action: indices or efforts [N].
        after: the next observations.
        name: of what holds them, for messages.

    Raises ConfigError for numbers that are not those of an observation in any order, sign or unit.
    """
    before, action, after = before[-_ROWS:], action[-_ROWS:], after[-_ROWS:]
    identity, motion = np.eye(before.shape[1], dtype=np.float32), motion_kind(dynamics)
    changes = list(observation_changes(dynamics).values())
    for change in (identity, *changes, *map(np.linalg.inv, changes)):
        if motion.explains(dynamics, before @ change, action, after @ change):
            return change
    if wrong := motion.are_observations(before, after):
        raise ConfigError(f"{name}: {wrong}; expected {motion.expected}")
    return identity
