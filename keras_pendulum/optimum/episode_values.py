"""The optimal values of an episode of the pendulum, in a table that is small enough to be stored.

V with 200 steps to go is computed on the fine grid of `value_iteration`. Every second column and
every fifth row of it are kept. The policy that is greedy on them, with a search in the first steps,
collects on average less than 0.01 below the best possible return, also at g = 10, where V has
discontinuities. A table that is computed on its own, coarser grid has them at wrong places.

The roots of the negative values are stored, in 65536 steps, which is the most precise near 0.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.environments.pendulum import STEPS_PER_EPISODE, Pendulum
from keras_pendulum.optimum.stored_results import (
    Arrays,
    Problem,
    join_words,
    split_words,
    stored_or_computed,
)
from keras_pendulum.optimum.value_iteration import solve

COLUMNS = 801  # of the table
COLUMN_STRIDE = 2
ROW_STRIDE = 5
ROWS = 641
LARGEST = np.iinfo(np.uint16).max


class EpisodeValues(NamedTuple):
    """V at the points of a grid: -(`roots` · `scale`)².

    Rows are θ̇ from -8 to 8 rad/s, columns are θ from -π to 0 rad. V(-θ, -θ̇) = V(θ, θ̇).
    """

    roots: NDArray[np.uint16]  # [ROWS, COLUMNS]
    scale: float


def episode_values(gravity: float) -> EpisodeValues:
    """Returns the optimal values with 200 steps to go, at a gravity g in m/s², 0 to 100.

    The package has those of g = 1 and g = 10. Others take about 30 s, and are stored in the user's
    cache folder, if it can be written. Raises ConfigError for a gravity out of range.
    """
    problem = Problem.valid(gravity)
    return stored_or_computed(
        file_name(problem),
        _unpack,
        lambda: solve_episode(problem.gravity),
        pack,
        f"the optimal values for g = {gravity:g}, once: about 30 s",
    )


def file_name(problem: Problem) -> str:
    """Returns the name of the file of a problem, such as `values_gravity_10.npz`."""
    return f"values_{problem.file_name}"


def solve_episode(gravity: float, columns: int = COLUMNS) -> EpisodeValues:
    """Returns the values by value iteration; fewer `columns` take less time."""
    table = solve(gravity, STEPS_PER_EPISODE, COLUMN_STRIDE * (columns - 1))
    roots = np.sqrt(-table[::ROW_STRIDE, ::COLUMN_STRIDE])
    scale = float(roots.max()) / LARGEST
    return EpisodeValues(np.rint(roots / scale).astype(np.uint16), scale)


def pack(values: EpisodeValues) -> Arrays:
    """Returns the arrays of a file."""
    return {"scale": values.scale, **split_words(differences(values.roots))}


def differences(words: NDArray[np.uint16]) -> NDArray[np.uint16]:
    """Returns the difference of each number from the one before, modulo 65536, one after another.

    They take a third of the space of the numbers in a compressed file.
    """
    return np.diff(words.ravel(), prepend=np.uint16(0))


def _unpack(arrays: Arrays) -> EpisodeValues | None:
    """Returns the values of a file's arrays; None where they cannot be right."""
    words, scale = join_words(arrays, (ROWS * COLUMNS,)), arrays.get("scale")
    if words is None or scale is None or scale.dtype != np.float64 or scale.shape != ():
        return None
    lowest = STEPS_PER_EPISODE * Pendulum.reward_range[0]
    if not 0 < float(scale) * LARGEST <= (-lowest) ** 0.5:  # false for NaN
        return None
    roots = np.cumsum(words, dtype=np.uint16).reshape(ROWS, COLUMNS)
    return EpisodeValues(roots, float(scale))
