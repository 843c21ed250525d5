"""The stored values of the pendulum's episodes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import keras_pendulum as kp
from keras_pendulum.environments.pendulum import Pendulum
from keras_pendulum.optimum import episode_values as module
from keras_pendulum.optimum.episode_values import (
    COLUMNS,
    ROWS,
    EpisodeValues,
    episode_values,
    file_name,
    pack,
    solve_episode,
)
from keras_pendulum.optimum.stored_results import Problem, write_arrays
from keras_pendulum.optimum.value_iteration import solve


def values_at_starts(values: EpisodeValues, count: int) -> Any:
    """Returns V at the grid points that are next to the starts of the first reset seeds."""
    theta, speed = Pendulum().starts(range(count)).T
    sign = np.where(theta > 0, -1, 1)  # V of the mirrored state is the same
    rows = np.rint((sign * speed / 8 + 1) / 2 * (ROWS - 1)).astype(int)
    columns = np.rint((1 - np.abs(theta) / np.pi) * (COLUMNS - 1)).astype(int)
    return -((values.roots[rows, columns] * values.scale) ** 2)


def coarse(gravity: float) -> EpisodeValues:
    """Returns values of a coarse grid, in a table of the right shape."""
    few = solve_episode(gravity, 11)
    columns = np.arange(COLUMNS) * 10 // (COLUMNS - 1)
    return EpisodeValues(few.roots[:, columns], few.scale)


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


def test_values_of_another_gravity_are_computed_once_and_read_from_the_cache(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(module, "solve_episode", coarse)
    first, again = episode_values(3.5), episode_values(3.5)
    assert len(caplog.records) == 1 and "g = 3.5" in caplog.text
    assert (first.roots == again.roots).all() and first.scale == again.scale


@pytest.mark.parametrize(
    "damage",
    [
        lambda arrays: arrays | {"high": arrays["high"][:-1]},
        lambda arrays: arrays | {"low": arrays["low"].astype(np.float32)},
        lambda arrays: {"high": arrays["high"], "low": arrays["low"]},
        lambda arrays: arrays | {"scale": np.nan},
        lambda arrays: arrays | {"scale": 0.0},
        lambda arrays: arrays | {"scale": 1.0},
        lambda arrays: arrays | {"scale": np.array([0.0001])},
    ],
)
def test_damaged_values_of_the_cache_are_computed_again(
    damage: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(module, "solve_episode", coarse)
    right = episode_values(3.5)
    write_arrays(tmp_path / "keras_pendulum" / file_name(Problem.valid(3.5)), damage(pack(right)))
    assert (episode_values(3.5).roots == right.roots).all()
    assert len(caplog.records) == 2


def test_gravity_out_of_range_is_refused() -> None:
    with pytest.raises(kp.ConfigError, match=r"^gravity is -1"):
        episode_values(-1)
