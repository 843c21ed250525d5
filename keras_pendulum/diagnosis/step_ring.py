"""The last steps of an environment in arrays that are written round and round."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from gymnasium.spaces import Box, Discrete, MultiDiscrete, Space
from numpy.typing import NDArray

from keras_pendulum.diagnosis.recorded_steps import LARGEST_RECORD, Steps
from keras_pendulum.errors import ConfigError
from keras_pendulum.evaluate.answers import plain_array

_LARGEST_SIZE = 64  # numbers of an observation, and of an action
# Kinds of rows.
NOTHING, RESET, STEP = -1, 0, 1
TERMINATED, TRUNCATED = 1, 2  # added to STEP

Array = NDArray[Any]


class Ring:
    """The last rows of an environment, or of B environments side by side, in ring arrays.

    A row has what a step returned, or the observation of a reset. The observation before a step is
    that of the row before. `acting` is the space of the actions without wrappers.
    """

    def __init__(
        self,
        observations: Space[Any],
        actions: Space[Any],
        acting: Space[Any],
        batch: tuple[int, ...] = (),
    ) -> None:
        for name, space in (("observations", observations), ("actions", actions)):
            if space.shape is None or math.prod(space.shape[len(batch) :]) > _LARGEST_SIZE:
                raise ConfigError(
                    f"the {name} of the environment are {space}; Recorder is for those of at most "
                    f"{_LARGEST_SIZE} numbers, such as Pendulum-v1 has"
                )
        integer = isinstance(actions, Discrete | MultiDiscrete)
        self.batch = batch
        self._capacity = LARGEST_RECORD // math.prod(batch)
        columns: list[tuple[Any, Any]] = [
            (observations.shape, np.float32),
            (actions.shape, np.int64 if integer else np.float32),
            (batch, np.float32),
            (batch, np.int8),
        ]
        # The system gives the memory of a row when it is written.
        self._arrays = [np.zeros((self._capacity, *shape), kind) for shape, kind in columns]
        self._rescaling = _rescaling(actions, acting)
        self._added = 0
        self.count = 0  # steps of the program

    def add(self, observation: Any, action: Any, reward: Any, kind: Any) -> None:
        """Stores a row; `kind` is NOTHING, RESET, or STEP plus the flags of its end."""
        i = self._added % self._capacity
        # Without a loop, because this is done at each step.
        observations, actions, rewards, kinds = self._arrays
        if self._rescaling:
            action = _rescaled(action, *self._rescaling)
        try:
            observations[i] = observation
            actions[i] = action
            rewards[i] = reward
        except Exception:  # what the environment takes and returns may have any shape and type
            for array, value in zip(self._arrays, (observation, action, reward), strict=False):
                array[i] = _fitted(value, array[i])
        kinds[i] = kind
        self._added += 1

    def steps(self) -> Steps:
        """Returns copies of all recorded steps, those of one environment after another."""
        rows = min(self._added, self._capacity)
        slots = (self._added - rows + np.arange(rows)) % self._capacity
        columns = []  # [B, rows, numbers]
        for array in self._arrays:
            shape = rows, math.prod(self.batch), math.prod(array.shape[1 + len(self.batch) :])
            columns.append(array.take(slots, axis=0).reshape(shape).swapaxes(0, 1))
        time = self._added - rows + np.arange(rows)
        parts = [_steps_of([*each, time]) for each in zip(*columns, strict=True)]
        joined = [np.concatenate(column) for column in zip(*parts, strict=True)]
        return Steps._make([*joined, np.array(self.count)])


def _fitted(value: Any, row: Array) -> Any:
    """Returns a value in the shape of a row; one of another size is NaN, or the index -1."""
    try:
        array = np.asarray(plain_array(value))
        return array.reshape(row.shape).astype(row.dtype)
    except (TypeError, ValueError, RuntimeError):
        return np.nan if row.dtype.kind == "f" else -1


def _rescaling(actions: Space[Any], acting: Space[Any]) -> tuple[Array, Array] | None:
    """Returns slope and shift from actions to those that act, where a wrapper rescales them."""
    if not (isinstance(actions, Box) and isinstance(acting, Box)):
        return None
    low, high = (np.asarray(each, np.float64) for each in (actions.low, actions.high))
    if not np.isfinite(high - low).all() or (high == low).any():
        return None
    slope = (acting.high - acting.low) / (high - low)
    shift = acting.low - slope * low
    return None if np.allclose(slope, 1) and np.allclose(shift, 0) else (slope, shift)


def _rescaled(action: Any, slope: Array, shift: Array) -> Any:
    try:
        return np.asarray(plain_array(action)) * slope + shift
    except (TypeError, ValueError, RuntimeError):
        return np.nan


def _steps_of(columns: list[Array]) -> list[Array]:
    """Returns the fields of `Steps` of one environment, from its rows in order."""
    used = columns[3][:, 0] != NOTHING
    observations, actions, rewards, kinds, time = (column[used] for column in columns)
    rewards, kinds = rewards[:, 0], kinds[:, 0]
    step = np.flatnonzero(kinds >= STEP)
    step = step[step > 0]  # the row before the oldest one is gone
    ends = kinds[step] - STEP
    return [
        observations[step - 1],
        actions[step, 0] if actions.shape[1] == 1 else actions[step],
        rewards[step],
        observations[step],
        (ends & TERMINATED) > 0,
        (ends & TRUNCATED) > 0,
        kinds[step - 1] == RESET,
        time[step],
    ]
