"""A Gymnasium wrapper that records the steps of a program, for `diagnose`."""

from __future__ import annotations

import math
import os
from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box, Discrete, MultiDiscrete, Space
from gymnasium.vector import AutoresetMode, VectorEnv, VectorWrapper
from numpy.typing import NDArray

from keras_pendulum.diagnosis.recorded_steps import (
    LARGEST_RECORD,
    Steps,
    plain_array,
    write_steps,
)
from keras_pendulum.errors import ConfigError

_LARGEST_SIZE = 64  # numbers of an observation, and of an action
# Kinds of rows.
_NOTHING, _RESET, _STEP = -1, 0, 1
_TERMINATED, _TRUNCATED = 1, 2  # added to _STEP

Array = NDArray[Any]


class _Ring:
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
        """Stores a row; `kind` is _NOTHING, _RESET, or _STEP plus the flags of its end."""
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
    used = columns[3][:, 0] != _NOTHING
    observations, actions, rewards, kinds, time = (column[used] for column in columns)
    rewards, kinds = rewards[:, 0], kinds[:, 0]
    step = np.flatnonzero(kinds >= _STEP)
    step = step[step > 0]  # the row before the oldest one is gone
    ends = kinds[step] - _STEP
    return [
        observations[step - 1],
        actions[step, 0] if actions.shape[1] == 1 else actions[step],
        rewards[step],
        observations[step],
        (ends & _TERMINATED) > 0,
        (ends & _TRUNCATED) > 0,
        kinds[step - 1] == _RESET,
        time[step],
    ]


class Recorder(gymnasium.Wrapper[Any, Any, Any, Any]):
    """An environment that records its last 200 000 steps, for `diagnose`.

    It changes nothing else. A vector environment is recorded, too: `Recorder(env)` is then a vector
    environment. Actions that a wrapper rescales are recorded as they act.

    Args:
        env: the environment, as the program uses it: put the recorder around all other wrappers,
            but for those that change the observations.

    Raises ConfigError for observations or actions that are not a few numbers.

    >>> import gymnasium
    >>> env = kp.Recorder(gymnasium.make("Pendulum-v1"))
    >>> observation, _ = env.reset(seed=0)
    >>> _ = env.step([0.5])
    >>> env.steps.action
    array([0.5], dtype=float32)
    """

    def __new__(cls, env: Any = None) -> Any:
        """Returns a recorder, of a vector environment where `env` is one."""
        if not isinstance(env, gymnasium.Env | VectorEnv | None):
            raise TypeError(
                f"env is a {type(env).__name__}; expected an environment of Gymnasium: "
                'kp.Recorder(gymnasium.make("Pendulum-v1"))'
            )
        return VectorRecorder(env) if isinstance(env, VectorEnv) else super().__new__(cls)

    def __init__(self, env: gymnasium.Env[Any, Any]) -> None:
        super().__init__(env)
        self._ring = _Ring(env.observation_space, env.action_space, env.unwrapped.action_space)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Resets the environment."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._ring.add(observation, 0, 0, _RESET)
        return observation, info

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Makes a step and records it."""
        result = self.env.step(action)
        observation, reward, terminated, truncated, _ = result
        ring = self._ring
        ring.count += 1
        ring.add(
            observation, action, reward, _STEP + _TERMINATED * terminated + _TRUNCATED * truncated
        )
        return result

    @property
    def steps(self) -> Steps:
        """Copies of the recorded steps."""
        return self._ring.steps()

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the recorded steps to a file, such as run.npz.

        Raises UserError without a step, where the path holds something else, and when the file
        system refuses.
        """
        write_steps(self.steps, path)


class VectorRecorder(VectorWrapper[Any, Any, Any, Any, Any]):
    """The recorder of a vector environment; `Recorder(env)` returns it."""

    def __init__(self, env: VectorEnv[Any, Any, Any]) -> None:
        super().__init__(env)
        inner = getattr(env.unwrapped, "envs", None)  # those of other processes are not at hand
        acting = inner[0].unwrapped.action_space if inner else env.unwrapped.single_action_space
        size = (env.num_envs,)
        self._ring = _Ring(env.observation_space, env.action_space, acting, size)
        self._mode = env.metadata.get("autoreset_mode", AutoresetMode.NEXT_STEP)
        self._resets = np.zeros(env.num_envs, bool)  # whether the next step is a reset

    def reset(
        self, *, seed: Any = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Resets the environments."""
        # Gymnasium removes the mask from the options.
        mask = np.zeros(self.num_envs, bool) | (options or {}).get("reset_mask", True)
        observations, info = self.env.reset(seed=seed, options=options)
        self._ring.add(observations, 0, 0, np.where(mask, _RESET, _NOTHING))
        self._resets &= ~mask
        return observations, info

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Makes a step of each environment and records it."""
        result = self.env.step(actions)
        observations, rewards, terminated, truncated, info = result
        ended = np.logical_or(terminated, truncated)
        ends = _TERMINATED * np.asarray(terminated) + _TRUNCATED * np.asarray(truncated)
        kinds = np.where(self._resets, _RESET, _STEP + ends)
        last = observations
        if self._mode == AutoresetMode.SAME_STEP and ended.any():
            last = np.array(observations)
            for row in np.flatnonzero(ended):
                last[row] = info["final_obs"][row]
        self._ring.count += int(np.count_nonzero(~self._resets))
        self._ring.add(last, actions, rewards, kinds)
        if last is not observations:
            self._ring.add(observations, 0, 0, np.where(ended, _RESET, _NOTHING))
        if self._mode == AutoresetMode.NEXT_STEP:
            self._resets = ended
        return result

    @property
    def steps(self) -> Steps:
        """Copies of the recorded steps."""
        return self._ring.steps()

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the recorded steps to a file, as `Recorder.save` does."""
        write_steps(self.steps, path)
