"""The training of a run as the page shows it: its learning curve and its networks.

The weights of a kernel have 12 bits each, which is two characters of base64: 20 networks of the
default size take 6.9 MB, in float16 they would take 9.2. The largest weight of a unit gets the code
2047. The Q-values of `reference` then differ from the exact ones by 0.0015 on average, with float16
by 0.0011, where those of a state extend over 3.4. The largest weights and the biases are the
snapshot's own, in float16.
"""

from __future__ import annotations

import base64
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.dqn.network import DQN
from keras_pendulum.figures.learning_curve import OPTIMUM, RANDOM, curve_values, trailing_mean
from keras_pendulum.optimum.solutions import solution
from keras_pendulum.storage.recorded_run import RecordedRun, load_recorded_run
from keras_pendulum.storage.run_folder import RunFolder
from keras_pendulum.storage.snapshots import read_snapshots

_BASE64 = np.frombuffer(
    b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/", np.uint8
)
_ZERO, _LARGEST = 2048, 2047  # of the 12 bits
_MOST_POINTS = 500  # of the learning curve


def training_content(folder: RunFolder, network: DQN) -> dict[str, Any] | None:
    """Returns the training of a run; None where the run has no snapshots.

    Args:
        folder: of the run.
        network: the network in its checkpoint. It is the last one of the training.

    Raises WeightsError when the snapshots are damaged or belong to another run.
    """
    if not folder.snapshots.exists():
        return None
    recorded = load_recorded_run(folder.weights)
    history = recorded.history
    snapshots = read_snapshots(folder.snapshots, network, history)
    # After the last episode, the exact network replaces its snapshot.
    before = [each for each in snapshots if each.episodes < len(history)]
    if not before:
        return None
    task = recorded.config.task
    shapes = [array.shape for array in network.get_weights()]
    return {
        "episodes": [*(each.episodes for each in before), len(history)],
        "untrained": sum(record.updates == 0 for record in history),
        "curve": _curve(curve_values(history, task)),
        "levels": _levels(recorded),
        "networks": [_encode(each.weights, shapes) for each in before],
    }


def _levels(run: RecordedRun) -> dict[str, float]:
    """Returns the best possible return and that of random actions, as the curve shows returns.

    They are left out for a pendulum beyond 200 steps, where they are not known.
    """
    exact, steps = solution(run.config.task), run.config.max_episode_steps
    returns = {OPTIMUM: exact.mean_best_return(steps), RANDOM: exact.random_return(steps)}
    if math.isnan(returns[OPTIMUM]):
        return {}
    mean_steps = run.history[-1].environment_steps / len(run.history)
    return {
        name: float(f"{run.config.task.curve_value(value, mean_steps):.4g}")
        for name, value in returns.items()
    }


def _curve(values: Sequence[float]) -> list[float]:
    """Returns evenly spaced points of the trailing mean, the first and the last one included."""
    ends = np.linspace(1, len(values), min(len(values), _MOST_POINTS)).round().astype(int)
    return [float(f"{value:.4g}") for value in trailing_mean(values)[ends - 1]]


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
