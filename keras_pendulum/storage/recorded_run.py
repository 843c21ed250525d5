"""The run that a checkpoint records: settings, history and replay buffer."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.config.config import Config
from keras_pendulum.config.settings import RENAMED, read_settings
from keras_pendulum.dqn.replay_buffer import Transitions
from keras_pendulum.errors import ConfigError, WeightsError
from keras_pendulum.history import EpisodeRecord
from keras_pendulum.storage.quarantine import H5File, open_h5

_INTEGERS = ("episode", "environment_steps", "updates")


@dataclass(frozen=True)
class RecordedRun:
    """The settings of a run, and a record for each of its episodes so far."""

    config: Config
    history: list[EpisodeRecord]


def load_recorded_run(path: str | os.PathLike[str]) -> RecordedRun:
    """Returns what a checkpoint records of its run.

    Raises WeightsError for a damaged file, and for one that holds weights without a run.
    """
    with open_h5(path) as file:
        return RecordedRun(read_config(read_state(file, path), path), read_history(file))


def load_transitions(path: str | os.PathLike[str]) -> Transitions:
    """Returns the transitions [N, ...] in the replay buffer of a checkpoint, oldest first.

    Raises WeightsError for a damaged file.
    """
    with open_h5(path) as file:
        fields = [np.asarray(file.read(f"replay/{name}")) for name in Transitions._fields]
        if len({len(array) for array in fields}) != 1:
            raise WeightsError(f"{os.fsdecode(path)}: its replay buffer is damaged")
    return Transitions(*fields)


def read_state(file: H5File, path: str | os.PathLike[str]) -> dict[str, Any]:
    """Returns the JSON of a checkpoint. Raises WeightsError for weights without a run."""
    if "run" not in file:
        raise WeightsError(
            f"{path}: holds weights without a run to resume; use --init to start a run from them"
        )
    state: dict[str, Any] = json.loads(file.read("run/state").tobytes())
    return state


def read_config(state: dict[str, Any], path: str | os.PathLike[str]) -> Config:
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


def read_arrays(file: H5File, group: str) -> Iterator[tuple[str, NDArray[Any]]]:
    """Yields the arrays of a group, by name."""
    for name in file:
        if name.startswith(f"{group}/"):
            yield name.removeprefix(f"{group}/"), file.read(name)


def history_arrays(history: list[EpisodeRecord]) -> dict[str, NDArray[np.float64]]:
    """Returns the arrays of the group `run` that `read_history` reads."""
    arrays = {"history": np.array([record[:-1] for record in history], np.float64)}
    evaluations = [
        (record.episode, record.greedy_regret)
        for record in history
        if not math.isnan(record.greedy_regret)
    ]
    if evaluations:
        arrays["evaluations"] = np.array(evaluations, np.float64)
    return arrays


def read_history(file: H5File) -> list[EpisodeRecord]:
    """Returns the records in a checkpoint. Its reader reports damage, see `open_h5`."""
    rows = file.read("run/history", finite=False)
    evaluations = file.read("run/evaluations") if "run/evaluations" in file else np.empty((0, 2))
    regrets = dict(zip(*evaluations.T.tolist(), strict=True))  # by episode
    history = []
    for row in rows.tolist():
        values = dict(zip(EpisodeRecord._fields[:-1], row, strict=True))
        values |= {name: int(values[name]) for name in _INTEGERS}
        history.append(EpisodeRecord(**values, greedy_regret=regrets.get(row[0], math.nan)))
    return history
