from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from keras_pendulum.environments.cartpole import CartPole
from keras_pendulum.environments.pendulum import Pendulum
from keras_pendulum.environments.task import Task
from keras_pendulum.figures.learning_curve import draw_learning_curve, trailing_mean
from keras_pendulum.history import EpisodeRecord

pytestmark = pytest.mark.quick

PENDULUM = Pendulum()


def drawn(returns: Sequence[float], references: Mapping[str, float], task: Task = PENDULUM) -> Axes:
    """Returns the panel of episodes of 60 steps."""
    axes = Figure().subplots()
    history = [
        EpisodeRecord(i, value / 60, value, 0.5, 0.1, 60 * (i + 1), i, 0.1)
        for i, value in enumerate(returns)
    ]
    draw_learning_curve(axes, history, task, references)
    return axes


def heights(line: Line2D) -> list[float]:
    return list(np.asarray(line.get_ydata()))


@pytest.mark.parametrize(
    ("task", "value", "optimum"), [(PENDULUM, -2, -0.5), (CartPole(), -120, -30)]
)
def test_reference_lines_have_the_scale_of_the_episodes(
    task: Task, value: float, optimum: float
) -> None:
    axes = drawn([-120.0] * 3, {"best possible": -30.0}, task)
    episodes, *_, line = axes.get_lines()
    assert heights(episodes) == [value] * 3
    assert heights(line) == [optimum] * 2


def test_reference_line_does_not_coincide_with_the_frame() -> None:
    # Just inside the default margins.
    axes = drawn([0.0, -60.0], {"best possible": 2.4, "random actions": -62.4})
    low, high = axes.get_ylim()
    assert high - 0.04 > 0.03
    assert -1.04 - low > 0.03


def test_curve_begins_at_the_first_episode() -> None:
    for returns in ([180.0], [180.0, 300.0]):
        mean = drawn(returns, {}).get_lines()[1]
        assert heights(mean) == [3.0, 4.0][: len(returns)]
        assert (mean.get_marker() == "o") == (len(returns) == 1)  # a line of one point is invisible


def test_cartpole_has_one_more_line_the_mean_of_100_episodes() -> None:
    returns = [float(i) for i in range(200)]
    _, short, long = drawn(returns, {}, CartPole()).get_lines()
    assert (short.get_label(), long.get_label()) == ("mean of 10 episodes", "mean of 100 episodes")
    assert (heights(short)[-1], heights(long)[-1]) == (194.5, 149.5)
    assert len(drawn(returns, {}).get_lines()) == 2


def test_legend_has_the_number_of_each_line() -> None:
    references = {"best possible": -12.204, "γ": -24.6, "random": -264.72, "steps": 30000.0}
    names = drawn([-60.0], references).get_legend_handles_labels()[1][-4:]
    # As many digits for each number, and the minus of the axis.
    assert names == ["best possible: −0.203", "γ: −0.410", "random: −4.41", "steps: 500"]


def test_trailing_mean_has_fewer_values_at_the_start() -> None:
    assert trailing_mean([4.0, 2.0, 0.0, 8.0], 2).tolist() == [4.0, 3.0, 1.0, 4.0]


def test_episodes_before_the_first_update_are_shaded() -> None:
    history = [
        EpisodeRecord(i, -1.0, -200.0, 0.5, 0.1, 200 * (i + 1), max(0, i - 2), 0.1)
        for i in range(6)
    ]
    axes = Figure().subplots()
    draw_learning_curve(axes, history, Pendulum(), {})
    (shade,) = axes.patches
    left, right = shade.get_extents().transformed(axes.transData.inverted()).intervalx
    assert (left, right) == pytest.approx((-0.5, 2.5))  # three episodes without an update
    axes = Figure().subplots()
    draw_learning_curve(axes, history[3:], Pendulum(), {})
    assert not axes.patches
