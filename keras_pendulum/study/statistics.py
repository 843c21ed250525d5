"""Interquartile means, bootstrap intervals and probabilities of improvement.

All three are from Agarwal et al. 2021, "Deep Reinforcement Learning at the Edge of the Statistical
Precipice". The bootstrap is stratified: runs are resampled within each arm. Intervals are
percentile intervals with a fixed seed.
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
_BATCH_NUMBERS = 2_000_000  # resampled at once, so that the memory does not grow with the runs
_TRIMMED = 0.25  # at either end


class Interval(NamedTuple):
    """An estimate and its 95 % interval; the bounds are NaN for a sample of one run."""

    value: float
    low: float
    high: float


def interquartile_mean(values: ArrayLike) -> Interval:
    """Returns the mean of the middle half of the runs' values [N], N at least 1."""
    sample = np.asarray(values, np.float64)
    value = float(trim_mean(sample, _TRIMMED))
    low, high = _bounds([sample], _iqm, _RESAMPLES)
    return Interval(value, float(low), float(high))


def curve_band(curves: ArrayLike) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Returns the interquartile mean of curves [N, points] and its bounds, each [points].

    The interval holds for each point alone, not for the whole curve.
    """
    sample = np.asarray(curves, np.float64)
    low, high = _bounds([sample], _iqm, _CURVE_RESAMPLES)
    return trim_mean(sample, _TRIMMED, axis=0), low, high


def probability_of_improvement(regrets: ArrayLike, baseline_regrets: ArrayLike) -> Interval:
    """Returns the probability that a run of an arm [N] has less regret than one of another [M].

    It is the Mann-Whitney statistic divided by N·M; a tie counts half.
    """
    samples = np.asarray(regrets, np.float64), np.asarray(baseline_regrets, np.float64)
    low, high = _bounds(samples, _share_below, _RESAMPLES)
    return Interval(float(_share_below(*samples)), float(low), float(high))


def _bounds(
    samples: Sequence[NDArray[np.float64]], statistic: Callable[..., Any], resamples: int
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Returns the interval of a statistic; runs are resampled along the samples' first axis."""
    if min(len(sample) for sample in samples) < 2:
        unknown = np.full(samples[0].shape[1:], math.nan)
        return unknown, unknown
    interval = bootstrap(
        samples,
        statistic,
        n_resamples=resamples,
        batch=max(1, _BATCH_NUMBERS // sum(sample.size for sample in samples)),
        vectorized=True,
        axis=0,
        confidence_level=CONFIDENCE,
        method="percentile",
        rng=np.random.default_rng(0),
    ).confidence_interval
    return np.asarray(interval.low), np.asarray(interval.high)


def _iqm(sample: NDArray[Any], axis: int = 0) -> Any:
    return trim_mean(sample, _TRIMMED, axis=axis)


def _share_below(sample: NDArray[Any], other: NDArray[Any], axis: int = 0) -> Any:
    pairs = sample.shape[axis] * other.shape[axis]
    above = mannwhitneyu(sample, other, axis=axis, method="asymptotic").statistic
    return 1 - above / pairs
