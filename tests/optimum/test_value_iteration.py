"""The dynamics and the tables, against Gymnasium's own steps."""

from __future__ import annotations

import functools
import itertools
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from keras_pendulum.environments.pendulum import Pendulum
from keras_pendulum.optimum.dynamics import simulate_return, step_all_torques
from keras_pendulum.optimum.value_iteration import greedy_return, solve, value_at, value_tables

TORQUES = np.linspace(-2, 2, 41)  # N·m


@functools.cache
def coarse_tables() -> list[NDArray[np.float32]]:
    """Returns the tables of the last 60 steps at g = 10."""
    return list(itertools.islice(value_tables(10.0, 100), 60))


@pytest.mark.parametrize("gravity", [1.0, 10.0])
def test_step_with_each_torque_equals_gymnasiums(gravity: float) -> None:
    states = np.array([(0.5, -0.3), (3.1, 7.9), (-2.0, -8.0), (9.0, 1.0)])
    results = np.stack(step_all_torques(gravity, *states.T), axis=-1)  # [N, A, 3]: reward, θ, θ̇
    env: Any = Pendulum(gravity).make_env().unwrapped
    for state, results_of_state in zip(states, results, strict=True):
        for torque, result in zip(TORQUES, results_of_state, strict=True):
            env.state, env.last_u = state, None
            reward = env.step(np.array([torque]))[1]
            np.testing.assert_allclose(result, [reward, *env.state], rtol=1e-12)


def test_simulated_return_is_gymnasiums_for_the_chosen_torques() -> None:
    starts = np.array([(0.5, -0.3), (3.1, 0.9)])
    indices = np.array([[0, 40], [20, 3], [7, 7]])  # [steps, N]
    env: Any = Pendulum(10.0).make_env().unwrapped
    expected = []
    for start, column in zip(starts, indices.T, strict=True):
        env.state, env.last_u = start, None
        expected.append(sum(env.step(TORQUES[[index]])[1] for index in column))
    returns = simulate_return(lambda step, *_: indices[step], 3, 10.0, starts)
    np.testing.assert_allclose(returns, expected, rtol=1e-12)


STARTS = np.array(
    [(0.3, -0.2), (-0.3, 0.7), (0.01, 0), (-0.1, 4), (0.2, -3), (1.5, 7.95), (-1.6, -7.9)]
)
# θ² has a kink at ±π, and a grid is less exact in the kink's cell.
STARTS_AT_THE_KINK = np.array([(3.1, 1), (-3.1, -2)])


@pytest.mark.parametrize("gravity", [1.0, 10.0])
@pytest.mark.parametrize(("starts", "tolerance"), [(STARTS, 2e-4), (STARTS_AT_THE_KINK, 0.03)])
def test_value_is_the_best_return_of_all_torque_sequences(
    gravity: float, starts: NDArray[np.float64], tolerance: float
) -> None:
    def best(theta: NDArray[np.float64], speed: NDArray[np.float64], horizon: int) -> Any:
        returns, next_theta, next_speed = step_all_torques(gravity, theta, speed)
        if horizon > 1:
            future = best(next_theta.ravel(), next_speed.ravel(), horizon - 1)
            returns = returns + future.reshape(returns.shape)
        return returns.max(axis=1)

    tables = list(itertools.islice(value_tables(gravity, 500), 4))
    theta, speed = starts.T
    for horizon in (1, 2, 3):
        found, expected = value_at(tables[horizon], theta, speed), best(theta, speed, horizon)
        np.testing.assert_allclose(found, expected, rtol=0, atol=tolerance)


def test_solve_returns_the_table_of_the_horizon() -> None:
    np.testing.assert_array_equal(solve(10.0, horizon=9, theta_cells=100), coarse_tables()[9])


def test_value_at_the_corners_of_the_grid_is_that_of_the_table() -> None:
    table = np.random.RandomState(0).rand(3201, 11).astype(np.float32)
    theta = np.array([-np.pi, -np.pi, -1e-12, -1e-12])
    value = value_at(table, theta, np.array([-8.0, 8.0, -8.0, 8.0]))
    np.testing.assert_allclose(value, table[[0, -1, 0, -1], [0, 0, -1, -1]], atol=1e-6)


def test_greedy_return_equals_gymnasiums() -> None:
    env: Any = Pendulum(10.0).make_env().unwrapped
    for seed in range(3):
        env.reset(seed=seed)
        simulated, total = greedy_return(coarse_tables(), 10.0, env.state[None]), 0.0
        for table in reversed(coarse_tables()):
            theta, speed = env.state
            next_speed = np.clip(speed + (15 * np.sin(theta) + 3 * TORQUES) * 0.05, -8, 8)
            value = value_at(table, theta + next_speed * 0.05, next_speed) - 0.001 * TORQUES**2
            total += env.step(TORQUES[value.argmax()][None])[1]
        assert total == pytest.approx(simulated[0], abs=1e-6)
