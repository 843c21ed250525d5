"""The picture of the benchmark `last_regret`."""

from __future__ import annotations

import numpy as np
import pytest
from figure_texts import figure_of, require_legible

from benchmarks.learning.last_regret import Episodes
from benchmarks.learning.last_regret_figure import draw


def make_episodes(seed: int) -> Episodes:
    """Returns random episodes of 70 steps from 20 starts."""
    random = np.random.RandomState(seed)
    theta, speed, lost, *others = random.uniform(-1, 1, (7, 70, 20))
    return Episodes(3 * theta, 7 * speed, np.abs(lost), *others)


@pytest.mark.parametrize("seeds", [2, 8])
def test_no_text_overlaps_another_or_leaves_the_picture(seeds: int) -> None:
    runs = {name: [make_episodes(i) for i in range(seeds)] for name in ("before", "reference")}
    value = -np.ones((3201, 41), np.float32)
    figure = figure_of(lambda: draw("reference", 1.0, runs, make_episodes(9), value))
    require_legible(figure)
    assert len(figure.axes) == 6  # with the colour bars
