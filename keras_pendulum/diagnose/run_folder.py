"""Reads the record of a run from its checkpoint."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.diagnose.run_record import RunRecord
from keras_pendulum.dqn.replay_buffer import Transitions
from keras_pendulum.errors import WeightsError
from keras_pendulum.storage.quarantine import open_h5, report_damage
from keras_pendulum.train.checkpoint import load_history


def read_record(path: str | os.PathLike[str]) -> RunRecord:
    """Returns settings, history and stored transitions of a checkpoint.

    Raises WeightsError for a damaged file, and for one that holds weights without a run.
    """
    config, history = load_history(path)
    arrays: dict[str, NDArray[Any]] = {}
    with open_h5(path) as file, report_damage(path):
        for name in Transitions._fields:
            arrays[name] = np.asarray(file.read(f"replay/{name}"))
    if len({len(array) for array in arrays.values()}) != 1:
        raise WeightsError(f"{os.fsdecode(path)}: its replay buffer is damaged")
    return RunRecord(config, history, Transitions(**arrays))
