from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import keras_pendulum as kp
from keras_pendulum.environments.pendulum import Pendulum
from keras_pendulum.optimum import phase_plane
from keras_pendulum.optimum.phase_plane import (
    EXTENT,
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
    plane = network_phase_plane(network, reward_scale=0.5)
    for row, column in ((0, 0), (10, 70), (UPRIGHT, UPRIGHT), (80, 3)):
        theta = THETA[column]
        q = network(np.array([[np.cos(theta), np.sin(theta), SPEED[row]]], np.float32)).numpy()[0]
        assert plane.torque[row, column] == pytest.approx(np.linspace(-2, 2, 41)[q.argmax()])
        assert plane.value[row, column] == pytest.approx(q.max() / 0.5, rel=1e-5)


def test_optimum_for_discount_0_is_no_torque_and_the_next_reward() -> None:
    plane = optimal_phase_plane(gravity=1.0, discount=0.0)
    assert (plane.torque == 0).all()
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
    optimal_phase_plane(1.0, discount)
    assert horizons == [horizon]


def test_extent_is_a_whole_turn_and_the_speed_limit() -> None:
    assert (-math.pi, math.pi, -8, 8) == EXTENT


@pytest.mark.parametrize(("gravity", "discount"), [(1.0, 0.9), (10.0, 0.985)])
def test_optimal_values_are_the_returns_of_the_optimal_torques(
    gravity: float, discount: float
) -> None:
    plane = optimal_phase_plane(gravity, discount)
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
        torque = plane.torque[np.abs(SPEED - speed).argmin(), np.abs(THETA - theta).argmin()]
        discounted_return += discount**step * float(env.step(np.array([torque]))[1])
    # Reading the torque at the nearest grid point costs some return, and cannot gain any.
    assert value * 1.15 - 0.5 < discounted_return < value * 0.99 + 0.5


@pytest.mark.parametrize(
    ("name", "discount", "max_offset", "max_error"),
    # Values go down to -74 and to -236. Those of swingup are too high by a common offset, which
    # changes no torque.
    [("reference", 0.9, 0.5, 0.5), ("swingup", 0.985, 35.0, 3.0)],
)
def test_shipped_networks_have_nearly_the_optimal_values_up_to_an_offset(
    name: str, discount: float, max_offset: float, max_error: float
) -> None:
    planes = run_phase_planes(kp.load_weights(name), kp.preset(name))
    assert list(planes) == ["This policy", f"Exact optimum for γ = {discount}"]
    learned, optimal = planes.values()
    visited = np.abs(SPEED) < 4
    error = (learned.value - optimal.value)[visited]
    offset = np.median(error)
    assert abs(offset) < max_offset
    assert np.median(np.abs(error - offset)) < max_error
    correlation = np.corrcoef(learned.value[visited].ravel(), optimal.value[visited].ravel())[0, 1]
    assert correlation > 0.95


def test_cartpole_has_no_phase_planes() -> None:
    network = kp.DQN((8,), 2, observation_size=4)
    assert run_phase_planes(network, kp.preset("cartpole")) == {}
