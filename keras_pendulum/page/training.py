"""The training of a run as the page shows it: its learning curve and its networks.

The weights of a kernel have 12 bits each, which is two characters of base64: 20 networks of the
default size take 6.9 MB, in float16 they would take 9.2. The largest weight of a unit gets the code
2047. The Q-values of `reference` then differ from the exact ones by 0.0015 on average, with float16
by 0.0011, where those of a state extend over 3.4. The largest weights and the biases are the
snapshot's own, in float16.
"""

from __future__ import annotations

import base64
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.dqn.network import DQN
from keras_pendulum.environments.tasks import TASKS
from keras_pendulum.storage.quarantine import open_h5
from keras_pendulum.storage.run_history import read_history
from keras_pendulum.storage.snapshots import read_snapshots, snapshots_file

_BASE64 = np.frombuffer(
    b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/", np.uint8
)
_ZERO, _LARGEST = 2048, 2047  # of the 12 bits
_MEAN_OVER = 10  # episodes, as in rewards.png
_MOST_POINTS = 500  # of the learning curve


def find_checkpoint(folder: str | os.PathLike[str]) -> Path | None:
    """Returns the checkpoint in the folder of a run, None for anything else."""
    files = [Path(folder) / task.weights_name for task in TASKS.values()]
    try:
        return next((file for file in files if file.is_file()), None)
    except OSError:  # a name that no file can have
        return None


def training_content(checkpoint: Path, network: DQN) -> dict[str, Any] | None:
    """Returns the training of a run; None where the run has no snapshots.

    Args:
        checkpoint: of the run.
        network: the network in it. It is the last one of the training.

    Raises WeightsError when the snapshots are damaged or belong to another run.
    """
    file = snapshots_file(checkpoint)
    if not file.exists():
        return None
    with open_h5(checkpoint) as content:
        history = read_history(content)
    # After the last episode, the exact network replaces its snapshot.
    before = [each for each in read_snapshots(file, network, history) if each[0] < len(history)]
    if not before:
        return None
    shapes = [array.shape for array in network.get_weights()]
    return {
        "episodes": [*(each.episodes for each in before), len(history)],
        "curve": _curve([record.average_reward for record in history]),
        "networks": [_encode(each.weights, shapes) for each in before],
    }


def _curve(rewards: Sequence[float]) -> list[float]:
    """Returns evenly spaced points of the trailing mean, the first and the last one included."""
    sums = np.cumsum([0.0, *rewards])
    ends = np.linspace(1, len(rewards), min(len(rewards), _MOST_POINTS)).round().astype(int)
    starts = np.maximum(ends - _MEAN_OVER, 0)
    return [float(f"{value:.4g}") for value in (sums[ends] - sums[starts]) / (ends - starts)]


def _encode(weights: NDArray[np.float16], shapes: Sequence[tuple[int, ...]]) -> dict[str, str]:
    """Returns kernels in 12 bits, and the largest weights and biases of the units in float16."""
    ends = np.cumsum([np.prod(shape) for shape in shapes])[:-1]
    arrays = [
        part.reshape(shape) for part, shape in zip(np.split(weights, ends), shapes, strict=True)
    ]
    characters, halves = [], []
    for kernel, bias in zip(arrays[::2], arrays[1::2], strict=True):
        largest = np.abs(kernel).max(axis=0)  # [out]
        shares = kernel / np.maximum(largest.astype(np.float32), np.finfo(np.float32).tiny)
        codes = np.rint(_LARGEST * shares).astype(int) + _ZERO  # [in, out]
        characters.append(_BASE64[np.stack([codes >> 6, codes & 63], axis=-1)].tobytes())
        halves += [largest, bias]
    return {
        "kernels": b"".join(characters).decode(),
        "halves": base64.b64encode(np.concatenate(halves).astype("<f2").tobytes()).decode(),
    }
