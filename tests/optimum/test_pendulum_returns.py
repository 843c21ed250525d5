from __future__ import annotations

import functools
import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from keras_pendulum.environments.pendulum import Pendulum
from keras_pendulum.errors import ConfigError
from keras_pendulum.optimum import best_return as module
from keras_pendulum.optimum.best_return import best_return
from keras_pendulum.optimum.pendulum import PendulumSolution
from keras_pendulum.optimum.solutions import optimal_return
from keras_pendulum.optimum.value_iteration import greedy_return, solve, value_tables

Array = NDArray[np.float64]
GRID = np.linspace(-2, 2, 41)  # N·m


def starts(count: int) -> Array:
    return Pendulum().starts(range(count))


def gymnasium_return(env: Any, start: Array, torques: list[float]) -> float:
    env.state, env.last_u = start, None
    return float(sum(env.step(np.array([torque]))[1] for torque in torques))


@functools.lru_cache(maxsize=1)
def coarse_tables(gravity: float) -> list[NDArray[np.float32]]:
    return list(itertools.islice(value_tables(gravity, 100), 200))


@pytest.fixture
def searched_starts(monkeypatch: pytest.MonkeyPatch) -> list[Array]:
    """Replaces the search by a function that records its starts and finds nothing."""
    recorded: list[Array] = []

    def record(table: NDArray[np.float32], gravity: float, start: Array, steps: int) -> float:
        recorded.append(start)
        return -np.inf

    monkeypatch.setattr(module, "_search_return", record)
    return recorded


def use_tables(monkeypatch: pytest.MonkeyPatch, tables: list[NDArray[np.float32]]) -> None:
    """Replaces the tables of every step by `tables`, and the fine table by the last of them.

    V has more and wider discontinuities in coarse tables than in the fine one.
    """
    monkeypatch.setattr(module, "solve", lambda gravity, steps: tables[-1])
    monkeypatch.setattr(module, "value_tables", lambda gravity, cells: iter(tables))


# Mean and tolerance by gravity, steps and number of seeds.
PUBLISHED = {
    (1, 200, 100): (-36.68, 0.05),
    (1, 200, 1000): (-40.69, 0.05),
    (10, 200, 100): (-132.5, 0.25),  # -132.7 was published, without two catches
    (10, 200, 1000): (-135.5, 0.3),
    (10, 40, 100): (-128.73, 0.01),  # these two were computed here, not published
    (10, 40, 1000): (-131.31, 0.01),
}


def test_shipped_returns_have_the_published_means(
    optimum_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "best_return", None)  # nothing is computed
    for (gravity, steps, count), (mean, tolerance) in PUBLISHED.items():
        returns = optimal_return(gravity, range(count), steps)
        assert returns.dtype == np.float64 and returns.shape == (count,)
        assert returns.mean() == pytest.approx(mean, abs=tolerance)
    assert not optimum_cache.exists()


@pytest.mark.parametrize(
    ("gravity", "steps", "max_gain", "max_mean_gain"),
    [(1.0, 200, 0.02, 0.01), (10.0, 200, 40.0, 1.0), (10.0, 40, 40.0, 1.0)],
)
def test_shipped_returns_are_at_least_those_of_a_coarse_policy(
    gravity: float, steps: int, max_gain: float, max_mean_gain: float
) -> None:
    gain = optimal_return(gravity, range(100), steps) - greedy_return(
        coarse_tables(gravity)[:steps], gravity, starts(100)
    )
    assert gain.min() > -1e-6
    assert gain.max() < max_gain  # at g = 10 a coarse policy misses whole catches
    assert gain.mean() < max_mean_gain
    assert np.median(gain) < 0.3


@pytest.mark.parametrize("steps", [1, 2])
def test_best_return_equals_the_best_of_all_torque_sequences(steps: int) -> None:
    env: Any = Pendulum(10.0).make_env().unwrapped
    states = starts(20)
    sequences = [[*first, 0.0] for first in itertools.product(GRID, repeat=steps - 1)]
    best = [max(gymnasium_return(env, start, torques) for torques in sequences) for start in states]
    np.testing.assert_allclose(best_return(10.0, states, steps), best, atol=1e-9)


@pytest.mark.parametrize(
    ("seed", "lowest"), [(28, -215.1), (657, -217.7), (535, -259.6), (855, -269.1)]
)
def test_shipped_returns_include_the_search(seed: int, lowest: float) -> None:
    assert optimal_return(10.0, [seed])[0] > lowest  # 17, 22, 1.2 and 1.2 more than without it


def test_search_improves_on_the_greedy_policies(monkeypatch: pytest.MonkeyPatch) -> None:
    tables = coarse_tables(10.0)
    use_tables(monkeypatch, tables)
    states = starts(835)[[0, 34, 53, 93, 834]]  # V is too low at three and too high at the last
    fine = greedy_return([tables[-1]] * 200, 10.0, states)
    greedy = np.maximum(fine, greedy_return(tables, 10.0, states))
    gain = best_return(10.0, states, 200) - greedy
    assert (gain >= 0).all()
    assert (gain > [-1, 0.5, 2, 10, 1]).all()


def test_search_tries_every_torque_in_three_steps() -> None:
    env: Any = Pendulum(10.0).make_env().unwrapped
    start = np.array([2.5, 1.0])

    def return_without_further_torque(torques: list[float]) -> float:
        return gymnasium_return(env, start, torques + [0.0] * (20 - len(torques)))

    path: list[float] = []
    best = []
    for _ in range(3):
        candidates = [[*path, torque] for torque in GRID]
        path = max(candidates, key=return_without_further_torque)
        best.append(return_without_further_torque(path))
    assert best[0] < best[1] - 1 < best[2] - 2
    zeros = np.zeros((3201, 101), np.float32)  # the policy that is greedy on it applies no torque
    assert module._search_return(zeros, 10.0, start, 20) == pytest.approx(best[2], abs=1e-9)
    one_step = gymnasium_return(env, start, [0.0])
    assert module._search_return(zeros, 10.0, start, 1) == pytest.approx(one_step)


def test_no_search_where_value_and_simulated_return_agree(
    monkeypatch: pytest.MonkeyPatch, searched_starts: list[Array]
) -> None:
    use_tables(monkeypatch, [solve(1.0, theta_cells=200)] * 200)
    difference = best_return(1.0, starts(100), 200) - optimal_return(1.0)
    assert np.abs(difference).max() < 0.01
    assert not searched_starts


def test_tables_of_each_step_are_used_where_the_pendulum_cannot_be_swung_up(
    monkeypatch: pytest.MonkeyPatch, searched_starts: list[Array]
) -> None:
    tables = coarse_tables(20.0)
    use_tables(monkeypatch, tables)
    one_table = greedy_return([tables[-1]] * 200, 20.0, starts(30)).mean()
    assert best_return(20.0, starts(30), 200).mean() > one_table + 30
    assert len(searched_starts) < 5  # the search continues with that one table, the worse policy


@pytest.mark.parametrize(("steps", "cells"), [(200, 100), (60, 333), (2, 1600)])
def test_tables_of_shorter_episodes_are_finer_in_the_same_memory(
    steps: int, cells: int, monkeypatch: pytest.MonkeyPatch, searched_starts: list[Array]
) -> None:
    requested_cells: list[int] = []
    zeros = np.zeros((3201, 101), np.float32)

    def record(gravity: float, theta_cells: int) -> Any:
        requested_cells.append(theta_cells)
        return itertools.repeat(zeros)

    monkeypatch.setattr(module, "solve", lambda gravity, steps: zeros)
    monkeypatch.setattr(module, "value_tables", record)
    best_return(10.0, starts(1), steps)
    assert requested_cells == [cells]


def test_gravities_steps_and_seeds_at_their_limits_are_accepted(
    optimum_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[tuple[float, int, int]] = []

    def record(gravity: float, starts: Array, steps: int) -> Array:
        calls.append((gravity, len(starts), steps))
        return np.full(len(starts), -7.0)

    monkeypatch.setattr(module, "best_return", record)
    for gravity in (0.0, 100.0):
        for steps in (1, 200):
            assert optimal_return(gravity, [0, 2**32 - 1], steps).tolist() == [-7.0, -7.0]
    assert calls == [(gravity, 1001, steps) for gravity in (0, 100) for steps in (1, 200)]


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ({"gravity": 100.00000000000001}, "gravity is .*; expected a number from 0 to 100"),
        ({"seeds": [-1]}, "seed is -1; expected a whole number from 0 to"),
        ({"seeds": [2**32]}, "seed is 4294967296; expected a whole number from 0 to"),
        ({"seeds": [0.5]}, "seed is 0.5; expected a whole number"),
        ({"steps": 0}, "steps is 0; expected a whole number from 1 to 200"),
        ({"steps": 201}, "steps is 201; expected a whole number from 1 to 200"),
        ({"discount": -0.1}, "discount is -0.1; expected a number from 0 to 1"),
        ({"discount": 1.1}, "discount is 1.1; expected a number from 0 to 1"),
        ({"discount": np.nan}, "discount is nan; expected a number from 0 to 1"),
    ],
    ids=str,
)
def test_number_out_of_range_is_refused(change: dict[str, Any], problem: str) -> None:
    with pytest.raises(ConfigError, match=problem):
        values = {"gravity": 1.0, "discount": 1.0, "seeds": [0], **change}
        PendulumSolution(Pendulum(values.pop("gravity"))).discounted_returns(**values)


def test_seeds_are_accepted_in_any_order_repeated_and_empty(optimum_cache: Path) -> None:
    first = optimal_return(1.0, range(100), 200)
    np.testing.assert_array_equal(optimal_return(), first)
    np.testing.assert_array_equal(optimal_return(1.0, iter([7, 2, 7])), first[[7, 2, 7]])
    assert optimal_return(1.0, np.arange(3)).tolist() == first[:3].tolist()
    assert optimal_return(1.0, []).shape == (0,)
