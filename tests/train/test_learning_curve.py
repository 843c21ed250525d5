from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from keras_pendulum.history import EpisodeRecord
from keras_pendulum.train.learning_curve import draw_curve, draw_learning_curve, trailing_mean

pytestmark = pytest.mark.quick


@pytest.mark.parametrize(
    ("environment", "value", "optimum"), [("Pendulum-v1", -2, -0.5), ("CartPole-v1", -120, -30)]
)
def test_reference_lines_have_the_scale_of_the_episodes(
    environment: str, value: float, optimum: float
) -> None:
    history = [EpisodeRecord(i, -2.0, -120.0, 0.5, 0.1, 60 * (i + 1), i, 0.1) for i in range(3)]
    axes = Figure().subplots()
    draw_learning_curve(axes, history, environment, {"best possible": -30.0})
    episodes, _, line = axes.get_lines()
    assert list(np.asarray(episodes.get_ydata())) == [value] * 3
    assert list(np.asarray(line.get_ydata())) == [optimum] * 2


def test_reference_line_does_not_coincide_with_the_frame() -> None:
    axes = Figure().subplots()
    lines = {"best possible": 0.04, "random actions": -1.04}  # just inside the default margins
    draw_curve(axes, [0.0, -1.0], "Return", mean_over=10, lines=lines)
    low, high = axes.get_ylim()
    assert high - 0.04 > 0.03
    assert -1.04 - low > 0.03


def test_curve_begins_at_the_first_episode() -> None:
    for values in ([3.0], [3.0, 5.0]):
        axes = Figure().subplots()
        draw_curve(axes, values, "Return", mean_over=10, lines={})
        mean = axes.get_lines()[1]
        assert np.asarray(mean.get_ydata()).tolist() == [3.0, 4.0][: len(values)]
        assert (mean.get_marker() == "o") == (len(values) == 1)  # a line of one point is invisible


def test_legend_has_the_number_of_each_line() -> None:
    axes = Figure().subplots()
    lines = {"best possible": -0.2034, "γ": -0.41, "random": -4.412, "steps": 500.0}
    draw_curve(axes, [-1.0], "Return", mean_over=10, lines=lines)
    names = axes.get_legend_handles_labels()[1][-4:]
    # As many digits for each number, and the minus of the axis.
    assert names == ["best possible: −0.203", "γ: −0.410", "random: −4.41", "steps: 500"]


def test_trailing_mean_has_fewer_values_at_the_start() -> None:
    assert trailing_mean([4.0, 2.0, 0.0, 8.0], 2).tolist() == [4.0, 3.0, 1.0, 4.0]
