"""The history of a run in its checkpoint: one record per episode."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.history import EpisodeRecord
from keras_pendulum.storage.quarantine import H5File


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
    integers = {"episode", "environment_steps", "updates"}
    history = []
    for row in rows.tolist():
        values = dict(zip(EpisodeRecord._fields[:-1], row, strict=True))
        values |= {name: int(values[name]) for name in integers}
        history.append(EpisodeRecord(**values, greedy_regret=regrets.get(row[0], math.nan)))
    return history
