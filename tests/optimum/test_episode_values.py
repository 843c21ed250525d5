"""The stored values of the pendulum's episodes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import keras_pendulum as kp
from keras_pendulum.environments.pendulum import Pendulum
from keras_pendulum.optimum.episode_values import (
    COLUMNS,
    ROWS,
    EpisodeValues,
    episode_values,
    solve_episode,
)
from keras_pendulum.optimum.value_iteration import solve


def values_at_starts(values: EpisodeValues, count: int) -> Any:
    """Returns V at the grid points that are next to the starts of the first reset seeds."""
    theta, speed = Pendulum().starts(range(count)).T
    sign = np.where(theta > 0, -1, 1)  # V of the mirrored state is the same
    rows = np.rint((sign * speed / 8 + 1) / 2 * (ROWS - 1)).astype(int)
    columns = np.rint((1 - np.abs(theta) / np.pi) * (COLUMNS - 1)).astype(int)
    return -((values.roots[rows, columns] * values.scale) ** 2)


@pytest.mark.parametrize("gravity", [1.0, 10.0])
def test_values_of_the_package_are_the_best_returns(gravity: float) -> None:
    difference = values_at_starts(episode_values(gravity), 1000)
    difference -= kp.optimal_return(gravity, range(1000))
    assert np.abs(np.median(difference)) < 0.1
    assert np.percentile(np.abs(difference), 90) < 3  # a start is up to half a cell from its point


def test_values_are_those_of_the_grid() -> None:
    values = solve_episode(10.0, 11)
    table = solve(10.0, theta_cells=20)[::5, ::2]
    assert values.roots.shape == table.shape == (ROWS, 11)
    np.testing.assert_allclose((values.roots * values.scale) ** 2, -table, rtol=0.01, atol=0.001)
