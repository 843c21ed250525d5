"""The signals of a diagnosis: pure functions of learned and exact Q-values.

`learned` and `exact` are [N, A]: one row for each state, one column for each torque. A row's mean
is the state's value. What is left, the row minus its mean, is the advantage of each torque: it
alone decides which torque is chosen.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Fit(NamedTuple):
    """The straight line through learned over exact values."""

    slope: float
    offset: float
    correlation: float


def line_fit(learned: Array, exact: Array) -> Fit:
    """Returns the fit of two arrays of one shape; 0 for the correlation of a constant."""
    x, y = exact.ravel().astype(np.float64), learned.ravel().astype(np.float64)
    deviation_x, deviation_y = x - x.mean(), y - y.mean()
    # Sums of NumPy, because the dot product of a long vector starts threads for microseconds.
    square_x, square_y = (deviation_x**2).sum(), (deviation_y**2).sum()
    product = (deviation_x * deviation_y).sum()
    slope = product / square_x if square_x > 0 else 0.0
    scale = np.sqrt(square_x) * np.sqrt(square_y)
    correlation = product / scale if scale > 0 else 0.0
    return Fit(float(slope), float(y.mean() - slope * x.mean()), float(correlation))


def advantages(q: Array) -> Array:
    """Returns the Q-values minus the mean of their state, [N, A]."""
    return q - q.mean(axis=1, keepdims=True)


def advantage_fit(learned: Array, exact: Array) -> Fit:
    """Returns the fit of the advantages of all states and torques."""
    return line_fit(advantages(learned), advantages(exact))


def output_efforts(learned: Array, exact: Array, torques: Array) -> Array:
    """Returns the torque that each output behaves like, [A], as a multiple of one unknown scale.

    The exact advantage is nearly proportional to the torque: λ(s)·u. Each output's advantage is
    projected on λ, so a healthy network gives its own torques times the slope of its values.
    """
    centred = torques - torques.mean()
    direction = advantages(exact) @ centred / (centred @ centred)  # [N]: λ, per N·m
    square = direction @ direction
    found: Array = advantages(learned).T @ direction / (square if square > 0 else 1.0)
    return found


def output_outliers(learned: Array, exact: Array) -> Array:
    """Returns how far each output's mean error is from that of the other outputs, [A].

    It is a robust z-score: the distance to the median, over the median distance times 1.48.
    """
    error = advantages(learned - exact).mean(axis=0)  # [A]
    distance = np.abs(error - np.median(error))
    spread = 1.48 * np.median(distance)
    return distance / max(spread, 1e-9 * (1 + np.abs(learned).max()))


def distances(observations: Array, sizes: tuple[float, ...], some: NDArray[np.intp]) -> Array:
    """Returns squared distances [S, N] of some observations to all of [N, D], for their order.

    A number that depends on the row alone is left out. `sizes` [D] are the units.
    """
    states = observations / np.array(sizes, np.float32)
    found: Array = (states**2).sum(axis=1) - 2 * (states[some] @ states.T)
    return found


def nearest(values: Array, torques: Array) -> NDArray[np.intp]:
    """Returns the index [N] of the torque nearest to each value [N]."""
    order = np.argsort(torques, kind="stable")
    ordered = torques[order]
    found: NDArray[np.intp] = order[np.searchsorted((ordered[1:] + ordered[:-1]) / 2, values)]
    return found
