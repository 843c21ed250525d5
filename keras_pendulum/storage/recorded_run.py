"""The run that a checkpoint records: settings, history, replay buffer and weights.

`read_run` is the only validation of a checkpoint's content: resume, `compare`, `diagnose`, `page`
and the pictures get what it returns.
"""

from __future__ import annotations

import json
import math
import os
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.config.config import Config
from keras_pendulum.config.settings import RENAMED, read_settings
from keras_pendulum.dqn.replay_buffer import Transitions
from keras_pendulum.errors import ConfigError, WeightsError
from keras_pendulum.history import EpisodeRecord
from keras_pendulum.storage.keras_h5 import Layer, read_layers
from keras_pendulum.storage.load_weights import GROUP, read_info
from keras_pendulum.storage.quarantine import H5File, open_h5

_LARGEST_STATE = 2**20  # bytes of JSON; a run has 15 KB
_LARGEST = 1e10  # of most numbers; a run has at most so many environment steps
_RANGES = {  # of the numbers of an episode
    "episode": (0, 1e6),
    "average_reward": (-_LARGEST, _LARGEST),
    "episode_return": (-_LARGEST, _LARGEST),
    "epsilon": (0, 1),
    "loss": (0, 3.5e38),  # or NaN
    "environment_steps": (1, _LARGEST),
    "updates": (0, _LARGEST),
    "seconds": (0, _LARGEST),
}
_COLUMNS = [*_RANGES]
_INTEGERS = ("episode", "environment_steps", "updates")
_TYPES = Transitions("float32", "int32", "float32", "float32", "bool")


@dataclass(frozen=True)
class RecordedRun:
    """A run with a record for each of its episodes so far."""

    config: Config
    history: list[EpisodeRecord]
    replay: Transitions  # [N, ...], the replay buffer, oldest first
    layers: list[Layer]  # of the online network
    state: dict[str, Any]  # further JSON, such as that of the random-number generators


def load_recorded_run(path: str | os.PathLike[str]) -> RecordedRun:
    """Returns what a checkpoint records of its run. Raises WeightsError as `read_run` does."""
    with open_h5(path) as file:
        return read_run(file)


def read_run(file: H5File) -> RecordedRun:
    """Returns what an open checkpoint records of its run.

    Raises WeightsError, or ValueError, which `open_h5` reports as damage: for a file that holds
    weights without a run; for settings that no run can have; and for a history, a replay buffer or
    layers that no run with these settings has.
    """
    state = _read_state(file)
    config = _read_config(state, file.path)
    task = config.task
    recorded = read_info(file.attributes.get(GROUP, {}), file.path).task
    if recorded not in (None, task):
        raise ValueError(f"its weights belong to {recorded.name}, its settings to {task.name}")
    layers = read_layers(file, task.observation_size, None)
    widths = [layer.bias.shape[0] for layer in layers]
    expected = [*config.hidden_units, task.action_count(config.torque_count)]
    if widths != expected:
        raise ValueError(f"its layers have {widths} units; its settings say {expected}")
    history = _read_history(file, config)
    added, steps = state["replay_added"], history[-1].environment_steps if history else 0
    if not isinstance(added, int) or added != steps:
        raise ValueError(f"replay_added is {added!r}; its history has {steps} steps")
    return RecordedRun(config, history, _read_replay(file, config, steps), layers, state)


def _read_state(file: H5File) -> dict[str, Any]:
    """Returns the JSON of a checkpoint. Raises WeightsError for weights without a run."""
    if "run" not in file:
        raise WeightsError(
            f"{file.path}: holds weights without a run to resume; use --init to start a run from "
            "them"
        )
    size = math.prod(file.shapes.get("run/state", ()))
    if size > _LARGEST_STATE:
        raise WeightsError(
            f"{file.path}: its run/state has {size} bytes; expected at most {_LARGEST_STATE}: "
            "the file is not a checkpoint of a run"
        )
    state: dict[str, Any] = json.loads(file.read("run/state").tobytes())
    return state


def _read_config(state: dict[str, Any], path: str) -> Config:
    """Returns the settings in the JSON of a checkpoint.

    Raises WeightsError for those of an older version, and for others that no run can have.
    """
    values = state["config"]
    renamed = sorted(RENAMED.keys() & values.keys())
    if renamed:
        raise WeightsError(
            f"{path}: this run was saved by an older version of keras_pendulum (it has the setting "
            f"{renamed[0]}) and cannot be resumed; use --init to start a run from its weights"
        )
    try:
        return read_settings(values)
    except ConfigError as error:
        raise WeightsError(f"{path}: records settings that no run can have ({error})") from error


def history_arrays(history: list[EpisodeRecord]) -> dict[str, NDArray[np.float64]]:
    """Returns the arrays of the group `run` that `_read_history` reads."""
    arrays = {"history": np.array([record[:-1] for record in history], np.float64)}
    evaluations = [
        (record.episode, record.greedy_regret)
        for record in history
        if not math.isnan(record.greedy_regret)
    ]
    if evaluations:
        arrays["evaluations"] = np.array(evaluations, np.float64)
    return arrays


def _read_history(file: H5File, config: Config) -> list[EpisodeRecord]:
    """Returns the records. Raises ValueError for those that no run with these settings has."""
    rows = file.read("run/history", finite=False).reshape(-1, len(_COLUMNS))
    if len(rows) > config.episodes:
        raise ValueError(f"it has {len(rows)} episodes; its settings say {config.episodes}")
    low, high = np.array(list(_RANGES.values())).T
    wrong = ~((low <= rows) & (rows <= high))  # true for NaN
    wrong[:, _COLUMNS.index("loss")] &= ~np.isnan(rows[:, _COLUMNS.index("loss")])
    integers = [_COLUMNS.index(name) for name in _INTEGERS]
    wrong[:, integers] |= rows[:, integers] % 1 != 0
    if wrong.any():
        i, k = np.argwhere(wrong)[0]
        raise ValueError(
            f"episode {i} has {_COLUMNS[k]} {rows[i, k]:g}; expected {low[k]:g} to {high[k]:g}"
        )
    steps = np.diff(rows[:, integers], axis=0, prepend=[[-1, 0, 0]])  # from episode to episode
    if (steps[:, 0] != 1).any() or (steps < [1, 1, 0]).any():
        raise ValueError("its episodes are not in order")
    regrets = _read_regrets(file, len(rows))
    history = []
    for row in rows.tolist():
        values = dict(zip(_COLUMNS, row, strict=True))
        values |= {name: int(values[name]) for name in _INTEGERS}
        history.append(EpisodeRecord(**values, greedy_regret=regrets.get(row[0], math.nan)))
    return history


def _read_regrets(file: H5File, episodes: int) -> dict[float, float]:
    """Returns the greedy regrets by episode. Raises ValueError for those of other episodes."""
    if "run/evaluations" not in file:
        return {}
    numbers, regrets = file.read("run/evaluations").T
    found = dict(zip(numbers.tolist(), regrets.tolist(), strict=True))
    if not found.keys() <= set(range(episodes)) or np.abs(regrets).max(initial=0) > _LARGEST:
        raise ValueError("its evaluations are of other episodes, or too large")
    return found


def _read_replay(file: H5File, config: Config, added: int) -> Transitions:
    """Returns the replay buffer after `added` transitions.

    Raises ValueError for arrays of other types or shapes, and for numbers out of range.
    """
    count, size = min(added, config.replay_capacity), config.task.observation_size
    shapes = Transitions((count, size), (count,), (count,), (count, size), (count,))
    arrays = {}
    for name, dtype, shape in zip(Transitions._fields, _TYPES, shapes, strict=True):
        found = file.shapes[f"replay/{name}"]
        if found != shape:
            raise ValueError(f"{name} of {count} transitions has shape {found}")
        arrays[name] = array = file.read(f"replay/{name}")
        if array.dtype != dtype:
            raise ValueError(f"{name} has the type {array.dtype}; expected {dtype}")
        largest = (
            config.task.action_count(config.torque_count) - 1 if name == "action" else _LARGEST
        )
        if name != "terminated" and np.abs(array).max(initial=0) > largest:
            raise ValueError(f"{name} has the size {np.abs(array).max():g}; expected {largest:g}")
    if arrays["action"].min(initial=0) < 0:
        raise ValueError("action is negative; expected an index")
    return Transitions(**arrays)
