"""Interquartile means, intervals and probabilities, compared with values computed by hand."""

from __future__ import annotations

import math

import numpy as np

from keras_pendulum.study.statistics import (
    curve_band,
    interquartile_mean,
    probability_of_improvement,
)


def test_interquartile_mean_leaves_out_the_outer_quarters() -> None:
    assert interquartile_mean([1000, 1, 2, 3, 4, 5, 6, -50]).value == (2 + 3 + 4 + 5) / 4
    assert interquartile_mean([7.0]).value == 7


def test_probability_of_improvement_counts_pairs_and_half_of_the_ties() -> None:
    # Less regret in the pairs (1, 2), (1, 3), (2, 3); a tie in (2, 2).
    assert probability_of_improvement([1, 2], [2, 3]).value == (3 + 0.5) / 4
    assert probability_of_improvement([5, 6], [1, 2, 3]).value == 0
    assert probability_of_improvement([1, 1], [2, 2]) == (1, 1, 1)


def test_interval_of_equal_runs_is_a_point_and_one_run_has_none() -> None:
    assert interquartile_mean([3.0] * 5) == (3, 3, 3)
    assert math.isnan(interquartile_mean([3.0]).low)
    assert math.isnan(probability_of_improvement([1.0], [1.0, 2.0]).high)


def test_interval_contains_the_true_mean_about_as_often_as_it_claims() -> None:
    random = np.random.default_rng(5)
    found = [interquartile_mean(random.normal(10, 1, 30)) for _ in range(60)]
    assert all(each.low < each.value < each.high for each in found)
    # With 30 runs a percentile interval covers a little less than 95 %.
    assert sum(each.low <= 10 <= each.high for each in found) >= 50
    assert interquartile_mean([1, 2, 3, 4]) == interquartile_mean([1, 2, 3, 4])  # seeded


def test_curve_band_has_the_interval_of_each_point() -> None:
    curves = np.array([[1.0, 5.0], [2.0, 5.0], [3.0, 5.0], [4.0, 5.0]])
    middle, low, high = curve_band(curves)
    assert middle.tolist() == [2.5, 5]
    assert (low[1], high[1]) == (5, 5)
    assert 1 <= low[0] < 2.5 < high[0] <= 4
