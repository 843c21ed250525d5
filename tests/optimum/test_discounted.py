"""The optimum for a discount, against Gymnasium's own steps and Bellman's equation."""

from __future__ import annotations

import functools
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from numpy.typing import NDArray

from keras_pendulum.environments.pendulum import Pendulum
from keras_pendulum.optimum import best_return, pendulum
from keras_pendulum.optimum.discounted import solve_discounted
from keras_pendulum.optimum.dynamics import TORQUES
from keras_pendulum.optimum.pendulum import PendulumSolution
from keras_pendulum.optimum.solutions import optimal_return
from keras_pendulum.optimum.stored_results import Problem
from keras_pendulum.optimum.value_iteration import solve, value_at

pytestmark = [pytest.mark.quick, pytest.mark.usefixtures("optimum_cache")]
CELLS = 40  # few, for speed


@functools.cache
def coarse_table(gravity: float, discount: float) -> NDArray[np.float32]:
    return solve_discounted(gravity, discount, CELLS)


@pytest.fixture
def solved(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Makes all tables small; the list has the cells that each computed table was asked for."""
    asked: list[int] = []

    def solve_coarsely(gravity: float, discount: float, cells: int) -> Any:
        asked.append(cells)
        return coarse_table(gravity, discount)

    monkeypatch.setattr(pendulum, "USUAL_SEEDS", range(20))
    monkeypatch.setattr(best_return, "solve_discounted", solve_coarsely)
    return asked


@pytest.mark.parametrize(("gravity", "discount"), [(1.0, 0.9), (10.0, 0.985)])
def test_exact_q_satisfies_bellmans_equation(gravity: float, discount: float) -> None:
    table = coarse_table(gravity, discount)
    theta = np.linspace(-np.pi, 0, CELLS + 1)
    for row in (0, 700, 1600, 2500, 3200):
        states = np.stack([theta, np.full(CELLS + 1, -8 + row * 0.005)], axis=1)
        q = PendulumSolution(Pendulum(gravity)).exact_q(table, discount, states, TORQUES)
        assert q.shape == (CELLS + 1, 41)
        np.testing.assert_allclose(q.max(axis=1), table[row], atol=0.005)


def test_exact_q_is_the_reward_and_the_discounted_value_after_a_step_of_gymnasium() -> None:
    table = solve_discounted(10, 0.9, CELLS)
    env: Any = gymnasium.make("Pendulum-v1", g=10.0).unwrapped
    torques = np.array([-2.0, 0.3, 1.77])
    states = np.array([(0.5, -7.9), (-3.0, 0.0), (2.0, 4.0)])
    q = PendulumSolution(Pendulum(10.0)).exact_q(table, 0.9, states, torques)
    for i, j in np.ndindex(3, 3):
        env.reset()
        env.state = states[i]
        reward = float(env.step(torques[j : j + 1])[1])
        value = value_at(table, env.state[:1], env.state[1:])[0]
        assert q[i, j] == pytest.approx(reward + 0.9 * value, abs=1e-9)


def test_value_for_discount_0_is_the_first_reward() -> None:
    table = solve_discounted(1, 0, CELLS)
    assert table[1600] == pytest.approx(-(np.linspace(-np.pi, 0, CELLS + 1) ** 2), abs=1e-5)


def test_value_for_discount_1_is_that_of_an_episode() -> None:
    np.testing.assert_array_equal(solve_discounted(1, 1, CELLS), solve(1, 200, CELLS))


@pytest.mark.parametrize(
    ("gravity", "discount", "steps", "cost"),
    [
        (1.0, 0.9, 200, 0.245),
        (1.0, 0.9, 100, 0.245),
        (10.0, 0.985, 200, 1.63),
        (10.0, 0.985, 40, 3.27),
        (1.0, 1.0, 200, 0.0),
    ],
)
def test_shipped_returns_are_below_the_optimum_by_what_the_discount_costs(
    gravity: float, discount: float, steps: int, cost: float, solved: list[int]
) -> None:
    returns = PendulumSolution(Pendulum(gravity)).discounted_returns(discount, range(100), steps)
    optimum = optimal_return(gravity, steps=steps)
    assert (optimum - returns).mean() == pytest.approx(cost, abs=0.02)
    assert (returns < optimum + 0.05).all()
    assert not solved


def test_shipped_returns_are_those_of_a_computation(solved: list[int]) -> None:
    shipped = PendulumSolution(Pendulum()).discounted_returns(0.9, range(20))
    computed = best_return.compute_returns(
        Problem.valid(1, discount=0.9), Pendulum().starts(range(20))
    )
    assert computed.mean() == pytest.approx(shipped.mean(), abs=0.1)
    assert solved == [best_return.DISCOUNTED_CELLS]


def test_other_returns_are_computed_once_and_stored(optimum_cache: Path, solved: list[int]) -> None:
    exact = PendulumSolution(Pendulum())
    first = exact.discounted_returns(0.6, [3, 2000])
    np.testing.assert_array_equal(exact.discounted_returns(0.6, [2000, 5, 3])[[2, 0]], first)
    assert solved == [best_return.DISCOUNTED_CELLS]
    assert [path.name for path in optimum_cache.iterdir()] == ["gravity_1_discount_0.6.npz"]
