"""Reads what a program hands in: the steps of a recorder, and the content of a replay buffer."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Sequence, Sized
from typing import Any

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.diagnosis.recorded_steps import Steps, read_steps
from keras_pendulum.diagnosis.recorder import Recorder, VectorRecorder
from keras_pendulum.diagnosis.signals import nearest
from keras_pendulum.dqn.replay_buffer import Transitions
from keras_pendulum.environments.task import Task
from keras_pendulum.environments.torque import MAX_TORQUE
from keras_pendulum.errors import ConfigError, UserError
from keras_pendulum.evaluate.answers import plain_array

Array = NDArray[Any]

_FIELDS = "(s, a, r, s′, done)"


def steps_of(record: Any, task: Task) -> Steps:
    """Returns the steps of a recorder, or those of its file.

    Raises TypeError for another object, UserError for a file that a recorder did not write, and
    ConfigError for steps of another environment.
    """
    while not isinstance(record, Recorder | VectorRecorder) and hasattr(record, "env"):
        record = record.env  # of a wrapper around the recorder
    if isinstance(record, Recorder | VectorRecorder):
        name, steps = "the recorder", record.steps
    elif isinstance(record, str | os.PathLike):
        name = os.fspath(record)
        steps = read_steps(name)
    else:
        raise TypeError(
            f"record is a {type(record).__name__}; expected a kp.Recorder, or the path of the file "
            "that its save() wrote"
        )
    if not len(steps.reward):
        raise UserError(f"{name} has no step: put it around the environment before the training")
    if steps.observation.shape[1] != task.observation_size or steps.action.ndim != 1:
        raise ConfigError(
            f"{name} has observations of {steps.observation.shape[1]} numbers and actions of the "
            f"shape {list(steps.action.shape[1:])}; those of {task.environment} are "
            f"{task.observation_size} and one number"
        )
    return steps


def transitions_of(given: Any, task: Task) -> Transitions:
    """Returns the transitions of a replay buffer; the actions are as given, float64 or int64 [N].

    Args:
        given: five arrays (s, a, r, s′, done), or a list of N such tuples; s and s′ may be [N, D],
            [N, D, 1], or [N, E, D] of E environments, the others [N] or [N, E].
        task: whose observations they are. Rows of zeros at the end are left out.

    Raises ConfigError, with the name of the field, for other arrays, and TypeError for an object
    that is not a sequence.
    """
    columns = _columns(given, task.observation_size)
    if not len(columns[0]):
        raise ConfigError(f"transitions is empty; expected {_FIELDS} of a replay buffer")
    named = dict(zip(Transitions._fields, columns, strict=True))
    arrays = {name: _as_array(name, column) for name, column in named.items()}
    shape = arrays["observation"].shape
    rows, several = shape[0], len(shape) == 3 and shape[2] == task.observation_size
    environments = shape[1] if several else 1
    for name, array in arrays.items():
        size = task.observation_size if name.endswith("observation") else 1
        if len(array) != rows or array.size != rows * environments * size:
            of_each = f" for each of {environments} environments" if environments > 1 else ""
            raise ConfigError(
                f"transitions: {name} has the shape {list(array.shape)}; expected {rows} times "
                f"{size} numbers{of_each}, in {_FIELDS}"
            )
        arrays[name] = array.reshape(rows, environments, size)
    # A buffer that is not full has rows of zeros behind those that were stored.
    seen = np.concatenate([arrays["observation"], arrays["next_observation"]], axis=1)
    used = np.flatnonzero(seen.any(axis=(1, 2)))
    stored = used[-1] + 1 if len(used) else rows
    # One environment after the other, so that each step stands behind the one before it.
    steps = (np.concatenate(array[:stored].swapaxes(0, 1)) for array in arrays.values())
    stored_columns = [array if array.shape[1] > 1 else array[:, 0] for array in steps]
    if not all(np.isfinite(column).all() for column in stored_columns):
        raise ConfigError("transitions: NaN or infinite numbers; expected finite ones")
    observation, action, reward, following, terminated = stored_columns
    if not np.isin(terminated, (0, 1)).all():
        raise ConfigError("transitions: done has other values than 0 and 1")
    return Transitions(
        observation.astype(np.float32),
        action.astype(np.float64) if action.dtype.kind == "f" else action.astype(np.int64),
        reward.astype(np.float32),
        following.astype(np.float32),
        terminated.astype(bool),
    )


def read_actions(
    actions: Array, torques: Array | None, name: str
) -> tuple[Array, NDArray[np.float64] | None]:
    """Returns the recorded actions as indices [N], and as torques in N·m where they are torques.

    A torque gets the index of the nearest one of `torques`. Without them, the torques are returned
    in place of the indices. Whole numbers from 0 to A - 1 are indices, unless they are
    floating-point numbers that are all torques, too. Larger torques are cut, as the pendulum does.

    Raises ConfigError, which begins with `name`, for numbers that are neither, and for indices
    without the torques that they stand for.
    """
    floating = actions.dtype.kind == "f"
    are_indices = bool((actions == np.floor(actions)).all() and (actions >= 0).all())
    if torques is not None:
        closest = nearest(actions, torques)
        are_torques = floating and np.mean(np.abs(actions - torques[closest]) < 1e-3) >= 0.95
        if are_indices and not are_torques and actions.max() < len(torques):
            return actions.astype(np.int32), None
    are_torques = torques is None or np.abs(torques).max() <= MAX_TORQUE
    if not are_torques:
        raise ConfigError(
            f"{name}: the actions are from {actions.min():g} to {actions.max():g}; expected the "
            "indices 0 and 1"
        )
    # A program may leave it to the pendulum to cut its torques; an agent with outputs does not.
    beyond = np.abs(actions).max() > MAX_TORQUE
    if floating and not are_indices:
        beyond = torques is not None and np.abs(actions).max() > 2 * MAX_TORQUE
    if torques is None and are_indices and (beyond or not floating):
        raise ConfigError(
            f"{name}: the actions are indices from {actions.min():g} to {actions.max():g} without "
            "their torques; give an agent that returns such an index, with torques= (--torques), "
            "or put the recorder inside the wrapper that maps them to torques"
        )
    if beyond or (are_indices and not floating):
        indices_allowed = "" if torques is None else f"indices from 0 to {len(torques) - 1}, or "
        raise ConfigError(
            f"{name}: the actions are from {actions.min():g} to {actions.max():g}; expected "
            f"{indices_allowed}torques from -2 to 2 N·m"
        )
    torque = actions.astype(np.float64).clip(-MAX_TORQUE, MAX_TORQUE)  # as the pendulum does
    return torque if torques is None else closest, torque


def _columns(given: Any, observed: int) -> Sequence[Any]:
    """Returns the five columns of arrays, or of a list of rows."""
    count = len(Transitions._fields)
    try:
        items = list(given)
    except TypeError:
        raise TypeError(
            f"transitions is a {type(given).__name__}; expected {_FIELDS}: five arrays, or a list "
            "of such tuples"
        ) from None
    if all(_is_row(item, observed) for item in items):
        return [[item[place] for item in items] for place in range(count)]
    if len(items) != count:
        other = next((item for item in items if not _is_row(item, observed)), None)
        raise ConfigError(
            f"transitions has {len(items)} items that are not all {_FIELDS}, but "
            f"{_described(other)}; expected five arrays, or a list of such tuples"
        )
    return items


def _is_row(item: Any, observed: int) -> bool:
    """Returns whether an item is a tuple (s, a, r, s′, done), not an array of one of them."""
    if isinstance(item, np.ndarray) and item.dtype == object and item.ndim == 1:
        item = item.tolist()
    if not isinstance(item, tuple | list) or len(item) != len(Transitions._fields):
        return False
    try:
        return [np.size(plain_array(each)) for each in item] == [observed, 1, 1, observed, 1]
    except ValueError:  # lists of several lengths
        return False


def _described(item: Any) -> str:
    size = f" of {len(item)}" if isinstance(item, Sized) else ""
    if isinstance(item, tuple | list):
        with contextlib.suppress(ValueError):  # lists of several lengths
            size += f" with the sizes {[np.size(plain_array(each)) for each in item]}"
    return f"a {type(item).__name__}{size}"


def _as_array(name: str, column: Any) -> Array:
    try:
        if isinstance(column, list | tuple):
            column = [plain_array(each) for each in column]
        array = np.asarray(plain_array(column))
        if array.dtype == object:
            array = np.asarray([plain_array(each) for each in array.tolist()])
    except (TypeError, ValueError):  # such as rows of several lengths
        array = np.empty(0, object)
    if array.dtype.kind not in "fiub" or array.ndim < 1:
        raise ConfigError(f"transitions: {name} is not an array of numbers, in {_FIELDS}")
    return array
