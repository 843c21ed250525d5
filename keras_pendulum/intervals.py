"""What a few runs say of all: interquartile means and bootstrap intervals.

After Agarwal et al. 2021, "Deep Reinforcement Learning at the Edge of the Statistical Precipice":
their interquartile mean, stratified bootstrap and probability of improvement. Runs are drawn again
within each arm: with one task, the arms are the strata. Intervals are percentiles, seeded.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import bootstrap, mannwhitneyu, trim_mean

CONFIDENCE = 0.95
_RESAMPLES = 9999
_CURVE_RESAMPLES = 999
_NUMBERS_AT_A_TIME = 2_000_000  # of resamples, so that many runs need no more memory than few
_TRIMMED = 0.25  # at either end


class Interval(NamedTuple):
    """An estimate and its 95 % interval; the bounds are NaN where one run cannot tell."""

    value: float
    low: float
    high: float


def interquartile_mean(values: ArrayLike) -> Interval:
    """The mean of the middle half of the runs' values [N], N at least 1."""
    sample = np.asarray(values, np.float64)
    value = float(trim_mean(sample, _TRIMMED))
    low, high = _bounds([sample], _iqm, _RESAMPLES)
    return Interval(value, float(low), float(high))


def curve_band(curves: ArrayLike) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """The interquartile mean of curves [N, points] and its bounds, point by point: [points] each.

    The band is of each point alone, not of the curve as a whole.
    """
    sample = np.asarray(curves, np.float64)
    low, high = _bounds([sample], _iqm, _CURVE_RESAMPLES)
    return trim_mean(sample, _TRIMMED, axis=0), low, high


def probability_of_improvement(regrets: ArrayLike, others: ArrayLike) -> Interval:
    """How likely a run of one arm [N] has less regret than one of another [M]; a tie is half.

    It is the Mann-Whitney statistic over N M.
    """
    ours, theirs = np.asarray(regrets, np.float64), np.asarray(others, np.float64)
    low, high = _bounds([ours, theirs], _share_below, _RESAMPLES)
    return Interval(float(_share_below(ours, theirs)), float(low), float(high))


def _bounds(
    samples: Sequence[NDArray[np.float64]], statistic: Callable[..., Any], resamples: int
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Each sample's runs are drawn again along its first axis."""
    if min(len(sample) for sample in samples) < 2:
        unknown = np.full(samples[0].shape[1:], math.nan)
        return unknown, unknown
    found = bootstrap(
        samples,
        statistic,
        n_resamples=resamples,
        batch=max(1, _NUMBERS_AT_A_TIME // sum(sample.size for sample in samples)),
        vectorized=True,
        axis=0,
        confidence_level=CONFIDENCE,
        method="percentile",
        rng=np.random.default_rng(0),
    ).confidence_interval
    return np.asarray(found.low), np.asarray(found.high)


def _iqm(sample: NDArray[Any], axis: int = 0) -> Any:
    return trim_mean(sample, _TRIMMED, axis=axis)


def _share_below(ours: NDArray[Any], theirs: NDArray[Any], axis: int = 0) -> Any:
    pairs = ours.shape[axis] * theirs.shape[axis]
    above = mannwhitneyu(ours, theirs, axis=axis, method="asymptotic").statistic
    return 1 - above / pairs
