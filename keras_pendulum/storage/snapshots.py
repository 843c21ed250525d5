"""Networks of a run at several of its episodes, in one `.h5` file.

The newest network is in the layout of Keras like in any weights file. The group `snapshots` holds
all of them in float16, which is precise enough to show them.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.dqn.network import DQN
from keras_pendulum.errors import WeightsError, require_finite
from keras_pendulum.history import EpisodeRecord
from keras_pendulum.storage.quarantine import open_h5
from keras_pendulum.storage.save_weights import encode_weights

_LARGEST = np.finfo(np.float16).max


class Snapshot(NamedTuple):
    """A network of a run."""

    episodes: int  # finished ones, 0 for the initial network
    average_reward: float  # of the last of these episodes; 0 for the initial network
    weights: NDArray[np.float16]  # [W], of all layers in the order of `DQN.get_weights`


def take_snapshot(network: DQN, history: Sequence[EpisodeRecord]) -> Snapshot:
    """Returns the present network of a run. Raises UserError when a weight is not finite."""
    weights = network.get_weights()
    require_finite(weights)
    flat = np.concatenate([array.ravel() for array in weights])
    reward = history[-1].average_reward if history else 0.0
    return Snapshot(len(history), reward, np.clip(flat, -_LARGEST, _LARGEST).astype(np.float16))


def encode_snapshots(network: DQN, snapshots: Sequence[Snapshot]) -> bytes:
    """Returns the file without its checksum; `network` is the newest one."""
    arrays: dict[str, NDArray[Any]] = {
        "episodes": np.array([each.episodes for each in snapshots], np.int64),
        "average_reward": np.array([each.average_reward for each in snapshots], np.float64),
        "weights": np.stack([each.weights for each in snapshots]),
    }
    return encode_weights(network, snapshots=arrays)


def read_snapshots(
    path: str | os.PathLike[str], network: DQN, history: Sequence[EpisodeRecord]
) -> list[Snapshot]:
    """Returns the snapshots of a run, the oldest first.

    Those of episodes that are not in the history are left out: the run was killed after them, and
    repeats them.

    Args:
        path: the file.
        network: a network of the run, for its size.
        history: the records of the run.

    Raises WeightsError when the file is damaged or belongs to another run.
    """
    name = os.fsdecode(path)
    with open_h5(path) as file:
        if "snapshots" not in file:
            raise WeightsError(f"{name}: holds no snapshots of a run (train --snapshots N)")
        episodes, rewards, weights = (
            file.read(f"snapshots/{key}") for key in ("episodes", "average_reward", "weights")
        )
        types = (episodes.dtype.kind, rewards.dtype.kind, weights.dtype.str)
        count = network.count_params()
        if (
            types != ("i", "f", "<f2")
            or episodes.ndim != 1
            or weights.shape != (len(episodes), count)
            or rewards.shape != episodes.shape
            or not (np.diff(episodes, prepend=-1) > 0).all()
        ):
            raise ValueError("its snapshots have wrong types, sizes or episodes")
    rewards_of_run = [0.0, *(record.average_reward for record in history)]
    found = [
        Snapshot(*each)
        for each in zip(episodes.tolist(), rewards.tolist(), weights, strict=True)
        if each[0] < len(rewards_of_run)
    ]
    if any(each.average_reward != rewards_of_run[each.episodes] for each in found):
        raise WeightsError(f"{name}: its snapshots are of another run; move it to another folder")
    return found
