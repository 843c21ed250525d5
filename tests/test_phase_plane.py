"""Maps of a policy over the phase plane, and the figures that show them."""

from __future__ import annotations

import io
import math

import matplotlib.image
import numpy as np
import pytest
from matplotlib.figure import Figure

import keras_pendulum as kp
from keras_pendulum import pictures
from keras_pendulum.episodes import EpisodeRecord
from keras_pendulum.phase_plane import POINTS, beside_optimum, of_network, of_optimum
from keras_pendulum.weights import find_weights

THETA = np.linspace(-np.pi, np.pi, POINTS)
SPEED = np.linspace(-8, 8, POINTS)
UPRIGHT = POINTS // 2


def test_a_networks_map_is_its_own_greedy_torque_and_value() -> None:
    network = kp.DQN((16,), seed=3)
    plane = of_network(network, reward_scale=0.5)
    for row, column in ((0, 0), (10, 70), (UPRIGHT, UPRIGHT), (80, 3)):
        theta = THETA[column]
        q = network(np.array([[np.cos(theta), np.sin(theta), SPEED[row]]], np.float32)).numpy()[0]
        assert plane.torque[row, column] == pytest.approx(np.linspace(-2, 2, 41)[q.argmax()])
        assert plane.value[row, column] == pytest.approx(q.max() / 0.5, rel=1e-5)


def test_without_foresight_the_best_is_no_torque_and_the_reward_at_hand() -> None:
    plane = of_optimum(gravity=1.0, discount=0.0)
    assert (plane.torque == 0).all()
    angle = np.abs(THETA)  # π and -π are the same place
    np.testing.assert_allclose(plane.value, -(angle**2) - 0.1 * SPEED[:, None] ** 2, rtol=1e-9)


@pytest.mark.parametrize(("gravity", "discount"), [(1.0, 0.9), (10.0, 0.98)])
def test_the_optimum_is_a_fixed_point_of_its_own_equation(gravity: float, discount: float) -> None:
    plane = of_optimum(gravity, discount)
    # Upright at rest the pendulum can stay, and a mirrored state is worth the same.
    assert plane.value[UPRIGHT, UPRIGHT] == pytest.approx(0, abs=1e-4)
    np.testing.assert_allclose(plane.value, plane.value[::-1, ::-1], atol=2e-2)
    # Followed from hanging still, the torques earn what the value says.
    env = kp.environment.make_environment("Pendulum-v1", gravity).unwrapped
    env.reset(seed=0)
    env.state = np.array([math.pi / 2, 0.0])  # type: ignore[attr-defined]
    promised = plane.value[UPRIGHT, np.abs(THETA - math.pi / 2).argmin()]
    earned = 0.0
    for step in range(200):
        theta, speed = env.state  # type: ignore[attr-defined]
        theta = (theta + np.pi) % (2 * np.pi) - np.pi
        torque = plane.torque[np.abs(SPEED - speed).argmin(), np.abs(THETA - theta).argmin()]
        earned += discount**step * float(env.step(np.array([torque]))[1])
    # The map is coarse; what it lacks in fineness costs some, and it can gain nothing.
    assert promised * 1.15 - 0.5 < earned < promised * 0.99 + 0.5


@pytest.mark.parametrize(
    ("name", "discount", "near"),
    [("reference", 0.9, 1.0), ("swingup", 0.98, 15.0)],  # of values from 0 to -74 and to -217
)
def test_the_shipped_networks_value_the_plane_as_the_optimum_does(
    name: str, discount: float, near: float
) -> None:
    maps = beside_optimum(kp.load_weights(find_weights(name)), kp.preset(name))
    assert list(maps) == ["This policy", f"Exact optimum for γ = {discount}"]
    learned, exact = maps.values()
    visited = np.abs(SPEED) < 4
    difference = np.abs(learned.value - exact.value)[visited]
    assert np.median(difference) < near
    assert np.corrcoef(learned.value[visited].ravel(), exact.value[visited].ravel())[0, 1] > 0.95


def test_cartpole_has_no_such_maps() -> None:
    network = kp.DQN((8,), 2, observation_size=4)
    assert beside_optimum(network, kp.preset("cartpole")) == {}


def test_the_figure_of_a_run_is_drawn_with_and_without_maps_and_losses() -> None:
    def record(episode: int, loss: float) -> EpisodeRecord:
        return EpisodeRecord(episode, -1.0, -200.0, 0.5, loss, 200 * (episode + 1), episode, 0.1)

    history = [record(i, math.nan if i < 5 else 1 / i) for i in range(30)]
    maps = {"one": of_network(kp.DQN((8,))), "two": of_optimum(1.0, 0.5)}
    sizes = []
    for planes in (maps, {}):
        for records in (history, history[:1]):
            returns = {"best possible": -40.0, "random actions": -900.0}
            png = pictures.finished_run(records, "Pendulum-v1", returns, planes)
            sizes.append(matplotlib.image.imread(io.BytesIO(png)).shape[:2])
    assert sizes == [(1250, 900)] * 2 + [(600, 900)] * 2
    assert matplotlib.image.imread(io.BytesIO(pictures.phase_planes(maps))).shape[:2] == (650, 900)


@pytest.mark.parametrize(
    ("environment", "value", "best"), [("Pendulum-v1", -2, -0.5), ("CartPole-v1", -120, -30)]
)
def test_the_levels_are_on_the_scale_of_the_episodes(
    environment: str, value: float, best: float
) -> None:
    history = [EpisodeRecord(i, -2.0, -120.0, 0.5, 0.1, 60 * (i + 1), i, 0.1) for i in range(3)]
    axes = Figure().subplots()
    pictures._draw_learning_curve(axes, history, environment, {"best possible": -30.0})
    episodes, level = axes.get_lines()
    assert list(np.asarray(episodes.get_ydata())) == [value] * 3
    assert list(np.asarray(level.get_ydata())) == [best] * 2


def test_a_level_does_not_lie_on_the_frame_of_the_learning_curve() -> None:
    axes = Figure().subplots()
    levels = {"best possible": 0.04, "random actions": -1.04}  # just inside the usual margins
    pictures._draw_curve(axes, [0.0, -1.0], "Return", mean_over=10, levels=levels)
    low, high = axes.get_ylim()
    assert high - 0.04 > 0.03
    assert -1.04 - low > 0.03
