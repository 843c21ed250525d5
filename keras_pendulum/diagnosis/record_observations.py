"""Finds the observation that a record has in another order, sign or unit, and undoes the change."""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.diagnosis.cartpole_motion import CartPoleMotion
from keras_pendulum.diagnosis.motion import Motion
from keras_pendulum.diagnosis.pendulum_motion import PendulumMotion
from keras_pendulum.diagnosis.recorded_steps import Steps
from keras_pendulum.diagnosis.states import observation_changes
from keras_pendulum.dqn.replay_buffer import Transitions
from keras_pendulum.errors import ConfigError
from keras_pendulum.optimum.known_dynamics import KnownDynamics

_ROWS = 5000

Recorded = TypeVar("Recorded", Steps, Transitions)


def motion_kind(dynamics: KnownDynamics) -> type[Motion]:
    """Returns the class of the motion of a task."""
    return PendulumMotion if dynamics.any_effort else CartPoleMotion


def undo_change(dynamics: KnownDynamics, recorded: Recorded, name: str) -> Recorded:
    """Returns the record with the observations [N, D] of the task.

    They stay as they are where they are right, and where no change makes them obey the dynamics.
    `name` is that of the record, for messages.

    Raises ConfigError for numbers that are not those of an observation in any order, sign or unit.
    """
    before, action, after = (
        each[-_ROWS:] for each in (recorded.observation, recorded.action, recorded.next_observation)
    )
    motion = motion_kind(dynamics)
    identity = np.eye(before.shape[1], dtype=np.float32)
    made: list[NDArray[Any]] = list(observation_changes(dynamics).values())
    for change in (identity, *made, *map(np.linalg.inv, made)):
        if motion.explains(dynamics, before @ change, action, after @ change):
            return recorded._replace(
                observation=recorded.observation @ change,
                next_observation=recorded.next_observation @ change,
            )
    if wrong := motion.are_observations(before, after):
        raise ConfigError(f"{name}: {wrong}; expected {motion.expected}")
    return recorded
