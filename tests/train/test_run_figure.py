from __future__ import annotations

import io
import math

import matplotlib.image
import numpy as np
import pytest
from matplotlib.figure import Figure

import keras_pendulum as kp
from keras_pendulum.history import EpisodeRecord
from keras_pendulum.optimum.phase_plane import network_phase_plane, optimal_phase_plane
from keras_pendulum.train import run_figure


def picture_size(png: bytes) -> tuple[int, ...]:
    """Returns height and width in pixels."""
    return matplotlib.image.imread(io.BytesIO(png)).shape[:2]


def test_run_is_drawn_with_and_without_phase_planes_losses_and_evaluations() -> None:
    def record(episode: int, loss: float) -> EpisodeRecord:
        return EpisodeRecord(episode, -1.0, -200.0, 0.5, loss, 200 * (episode + 1), episode, 0.1)

    history = [record(i, math.nan if i < 5 else 1 / i) for i in range(30)]
    planes = {"one": network_phase_plane(kp.DQN((8,))), "two": optimal_phase_plane(1.0, 0.5)}
    returns = {"best possible": -40.0, "random actions": -900.0}
    sizes = [
        picture_size(run_figure.draw_run(records, "Pendulum-v1", returns, planes_or_none))
        for planes_or_none in (planes, {})
        for records in (history, history[:1])
    ]
    assert sizes == [(1250, 900)] * 2 + [(600, 900)] * 2
    assert picture_size(run_figure.draw_phase_planes(planes)) == (650, 900)
    history[19] = history[19]._replace(greedy_regret=3.0)
    sizes = [
        picture_size(run_figure.draw_run(history, "Pendulum-v1", returns, planes_or_none))
        for planes_or_none in (planes, {})
    ]
    assert sizes == [(1550, 900), (900, 900)]


def test_greedy_regret_is_drawn_by_episode_with_its_best() -> None:
    regrets = {9: 800.0, 19: 0.0, 29: 20.0, 39: 0.0}
    evaluated = [
        EpisodeRecord(i, -1.0, -200.0, 0.5, 0.1, 200, i, 0.1, regret)
        for i, regret in regrets.items()
    ]
    axes = Figure().subplots()
    run_figure._draw_greedy_regret(axes, evaluated)
    curve, best = axes.get_lines()
    assert dict(zip(*map(np.asarray, curve.get_data()), strict=True)) == regrets
    assert list(np.asarray(best.get_xdata())) == [39]  # the later of two equals
    assert best.get_label() == "best: 0.00 after episode 39"
    low, high = axes.get_ylim()
    assert low < -0.05  # no point is on the frame
    assert high > 1000


@pytest.mark.parametrize(
    ("environment", "value", "optimum"), [("Pendulum-v1", -2, -0.5), ("CartPole-v1", -120, -30)]
)
def test_reference_lines_have_the_scale_of_the_episodes(
    environment: str, value: float, optimum: float
) -> None:
    history = [EpisodeRecord(i, -2.0, -120.0, 0.5, 0.1, 60 * (i + 1), i, 0.1) for i in range(3)]
    axes = Figure().subplots()
    run_figure._draw_learning_curve(axes, history, environment, {"best possible": -30.0})
    episodes, line = axes.get_lines()
    assert list(np.asarray(episodes.get_ydata())) == [value] * 3
    assert list(np.asarray(line.get_ydata())) == [optimum] * 2


def test_reference_line_does_not_coincide_with_the_frame() -> None:
    axes = Figure().subplots()
    lines = {"best possible": 0.04, "random actions": -1.04}  # just inside the default margins
    run_figure._draw_curve(axes, [0.0, -1.0], "Return", mean_over=10, lines=lines)
    low, high = axes.get_ylim()
    assert high - 0.04 > 0.03
    assert -1.04 - low > 0.03


def test_phase_planes_have_their_lowest_speed_at_the_bottom() -> None:
    figure = Figure()
    planes = {"optimum": optimal_phase_plane(1.0, 0.5)}
    run_figure._draw_planes(figure, figure.add_gridspec(1, 1)[0], planes)
    images = [image for axes in figure.axes for image in axes.get_images()]
    assert [image.origin for image in images] == ["lower", "lower"]
    assert images[0].get_extent() == pytest.approx((-math.pi, math.pi, -8, 8))
