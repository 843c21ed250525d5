from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import keras_pendulum as kp
from keras_pendulum.environments.pendulum import Pendulum
from keras_pendulum.optimum import phase_plane
from keras_pendulum.optimum.cartpole import CartPoleSolution
from keras_pendulum.optimum.cartpole_dynamics import FORCES
from keras_pendulum.optimum.phase_plane import (
    POINTS,
    network_phase_plane,
    optimal_phase_plane,
    run_phase_planes,
)

THETA = np.linspace(-np.pi, np.pi, POINTS)  # rad
SPEED = np.linspace(-8, 8, POINTS)  # rad/s
UPRIGHT = POINTS // 2


def test_network_phase_plane_has_the_greedy_torques_and_values() -> None:
    network = kp.DQN((16,), seed=3)
    plane = network_phase_plane(network, Pendulum(), reward_scale=0.5)
    for row, column in ((0, 0), (10, 70), (UPRIGHT, UPRIGHT), (80, 3)):
        theta = THETA[column]
        q = network(np.array([[np.cos(theta), np.sin(theta), SPEED[row]]], np.float32)).numpy()[0]
        assert plane.effort[row, column] == pytest.approx(np.linspace(-2, 2, 41)[q.argmax()])
        assert plane.value[row, column] == pytest.approx(q.max() / 0.5, rel=1e-5)


def test_optimum_for_discount_0_is_no_torque_and_the_next_reward() -> None:
    plane = optimal_phase_plane(Pendulum(), discount=0.0)
    assert (plane.effort == 0).all()
    angle = np.abs(THETA)  # π and -π are the same angle
    np.testing.assert_allclose(plane.value, -(angle**2) - 0.1 * SPEED[:, None] ** 2, rtol=1e-9)


@pytest.mark.parametrize(
    ("discount", "horizon"), [(0.0, 200), (0.5, 10), (0.9, 66), (0.985, 200), (1.0, 200)]
)
def test_optimum_counts_the_steps_whose_discount_factor_is_above_a_thousandth(
    discount: float, horizon: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    def record(gravity: float, steps: int, cells: int, gamma: float) -> Any:
        horizons.append(steps)
        return np.zeros((3201, cells + 1), np.float32)

    horizons: list[int] = []
    monkeypatch.setattr(phase_plane, "solve", record)
    optimal_phase_plane(Pendulum(), discount)
    assert horizons == [horizon]


@pytest.mark.parametrize(("gravity", "discount"), [(1.0, 0.9), (10.0, 0.985)])
def test_optimal_values_are_the_returns_of_the_optimal_torques(
    gravity: float, discount: float
) -> None:
    plane = optimal_phase_plane(Pendulum(gravity), discount)
    # Upright and at rest, the pendulum needs no torque. A mirrored state has the same value.
    assert plane.value[UPRIGHT, UPRIGHT] == pytest.approx(0, abs=1e-4)
    np.testing.assert_allclose(plane.value, plane.value[::-1, ::-1], atol=2e-2)
    # The torques, applied from a horizontal start at rest, attain the start's value.
    env: Any = Pendulum(gravity).make_env().unwrapped
    env.reset(seed=0)
    env.state = np.array([math.pi / 2, 0.0])
    value = plane.value[UPRIGHT, np.abs(THETA - math.pi / 2).argmin()]
    discounted_return = 0.0
    for step in range(200):
        theta, speed = env.state
        theta = (theta + np.pi) % (2 * np.pi) - np.pi
        torque = plane.effort[np.abs(SPEED - speed).argmin(), np.abs(THETA - theta).argmin()]
        discounted_return += discount**step * float(env.step(np.array([torque]))[1])
    # Reading the torque at the nearest grid point costs some return, and cannot gain any.
    assert value * 1.15 - 0.5 < discounted_return < value * 0.99 + 0.5


def test_run_has_the_planes_of_its_network_and_of_its_optimum() -> None:
    network, config = kp.DQN((8,)), kp.preset("swingup")
    learned, optimal = run_phase_planes(network, config).items()
    assert (learned[0], optimal[0]) == ("This policy", "Exact optimum for γ = 0.985")
    expected = network_phase_plane(network, config.task, config.reward_scale)
    np.testing.assert_array_equal(learned[1].value, expected.value)
    expected = optimal_phase_plane(config.task, 0.985)
    np.testing.assert_array_equal(optimal[1].value, expected.value)


def test_cartpole_has_the_planes_of_the_cart_at_rest_in_the_middle() -> None:
    network, config = kp.load_weights("cartpole"), kp.preset("cartpole")
    learned, optimal = run_phase_planes(network, config).values()
    exact = CartPoleSolution(config.task)
    for row, column in ((UPRIGHT, UPRIGHT), (10, 70), (60, 20)):
        theta, speed = np.linspace(-1, 1, POINTS)[[column, row]] * exact.phase_ends
        state = np.array([[0, 0, theta, speed]])
        q = network(state.astype(np.float32)).numpy()[0] / config.reward_scale
        assert learned.effort[row, column] == FORCES[q.argmax()]
        assert learned.value[row, column] == pytest.approx(q.max(), rel=1e-4)
        q = exact.exact_q(exact.table(config.discount), config.discount, state, FORCES)[0]
        assert optimal.value[row, column] == pytest.approx(q.max())
        expected = FORCES[q.argmax()] if exact.survives(state)[0] else 0
        assert optimal.effort[row, column] == expected
    assert 0.2 < (optimal.effort == 0).mean() < 0.8  # all is lost there
