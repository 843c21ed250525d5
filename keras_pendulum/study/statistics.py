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

_RESAMPLES = 9999
_CURVE_RESAMPLES = 999
_BATCH_NUMBERS = 2_000_000  # resampled at once, so that the memory does not grow with the runs
_TRIMMED = 0.25  # at either end


class Interval(NamedTuple):
    """An estimate and its 95 % interval; the bounds are NaN for a sample of one run."""

    value: Any  # a number, or [points] of a curve
    low: Any
    high: Any


def interquartile_mean(values: ArrayLike) -> Interval:
    """Returns the mean of the middle half of the runs' values [N], N at least 1."""
    return _estimate([values], _iqm, _RESAMPLES)


def curve_band(curves: ArrayLike) -> Interval:
    """Returns the interquartile mean of curves [N, points] and its bounds, each [points].

    The interval holds for each point alone, not for the whole curve.
    """
    return _estimate([curves], _iqm, _CURVE_RESAMPLES)


def probability_of_improvement(regrets: ArrayLike, baseline_regrets: ArrayLike) -> Interval:
    """Returns the probability that a run of an arm [N] has less regret than one of another [M].

    It is the Mann-Whitney statistic divided by N·M; a tie counts half.
    """
    return _estimate([regrets, baseline_regrets], _share_below, _RESAMPLES)


def _estimate(runs: Sequence[ArrayLike], statistic: Callable[..., Any], resamples: int) -> Interval:
    """Returns a statistic with its interval; runs are resampled along the first axis."""
    samples = [np.asarray(each, np.float64) for each in runs]
    value = statistic(*samples)
    if min(map(len, samples)) < 2:
        return Interval(value, value * math.nan, value * math.nan)
    interval = bootstrap(
        samples,
        statistic,
        n_resamples=resamples,
        batch=max(1, _BATCH_NUMBERS // sum(sample.size for sample in samples)),
        confidence_level=0.95,
        method="percentile",
        rng=np.random.default_rng(0),
    ).confidence_interval
    return Interval(value, *interval)


def _iqm(sample: NDArray[Any], axis: int = 0) -> Any:
    return trim_mean(sample, _TRIMMED, axis=axis)


def _share_below(sample: NDArray[Any], other: NDArray[Any], axis: int = 0) -> Any:
    pairs = sample.shape[axis] * other.shape[axis]
    above = mannwhitneyu(sample, other, axis=axis, method="asymptotic").statistic
    return 1 - above / pairs
