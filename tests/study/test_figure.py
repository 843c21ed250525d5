"""The figure of a study: each arm has its own curve, and all labels are legible."""

from __future__ import annotations

import numpy as np
import pytest
from figure_texts import figure_of, require_legible
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from keras_pendulum.figures.learning_curve import RANDOM
from keras_pendulum.study.arms import Arm, default_arms, own_arms
from keras_pendulum.study.figure import draw_study
from keras_pendulum.study.job import RunResult
from keras_pendulum.study.table import make_rows


def drawn(arms: list[Arm], seeds: int = 1) -> Figure:
    """Returns the figure; the n-th arm (from 0) has the greedy regrets n + 1 and n + 1.5."""
    results = {
        arm.name: [
            RunResult(0.0, [-9.0 * 4 ** (n % 5) - seed], [], [], [n + 1, n + 1.5])
            for seed in range(seeds)
        ]
        for n, arm in enumerate(arms)
    }
    return figure_of(lambda: draw_study(make_rows(arms, results), results))


def panels(figure: Figure) -> dict[str, dict[str, Line2D]]:
    """Returns the curves by task and arm."""
    return {
        axes.get_title().split(":")[0]: {
            name: line for line in axes.lines if (name := str(line.get_label())) != RANDOM
        }
        for axes in figure.axes[1:]
    }


def test_each_arm_draws_its_own_curve() -> None:
    figure = drawn(own_arms(["reference", "original", "cartpole"], []))
    values = {
        task: {name: np.asarray(line.get_ydata()).tolist() for name, line in lines.items()}
        for task, lines in panels(figure).items()
    }
    assert values == {
        "Pendulum-v1, g = 1": {"reference": [1, 1.5], "original": [2, 2.5]},
        "CartPole-v1": {"cartpole": [3, 3.5]},
    }
    for axes in figure.axes[1:]:
        assert axes.get_yscale() == "symlog"
        assert axes.get_ylabel().startswith("Greedy regret")
    # The reference is evaluated after every 50 of its 500 episodes.
    line = panels(figure)["Pendulum-v1, g = 1"]["reference"]
    assert np.asarray(line.get_xdata()).tolist() == [50, 100]


def test_random_actions_are_a_line_and_many_curves_have_no_bands() -> None:
    for count, bands in ((3, 3), (4, 0)):
        axes = drawn(own_arms([], [f"arm{n}: reference" for n in range(count)])).axes[1]
        (line,) = [each for each in axes.lines if each.get_label() == RANDOM]
        assert np.asarray(line.get_ydata())[0] == pytest.approx(884, abs=5)
        kinds = [type(each).__name__ for each in axes.collections]
        assert kinds.count("FillBetweenPolyCollection") == bands
        assert kinds.count("LineCollection") == (0 if bands else count)


def test_more_arms_than_colours_have_different_curves() -> None:
    many = [f"arm{n}: reference" for n in range(12)]
    figure = drawn(own_arms([], [*many, "pole: cartpole"]))
    assert [len(lines) for lines in panels(figure).values()] == [12, 1]
    lines = [line for panel in panels(figure).values() for line in panel.values()]
    assert len({(line.get_color(), line.get_marker()) for line in lines}) == 13


@pytest.mark.parametrize(
    ("arms", "seeds"),
    [
        (default_arms(), 3),
        (own_arms(["reference"], []), 1),
        (own_arms([], [*(f"arm{n}: reference" for n in range(10)), "pole: cartpole"]), 3),
        (own_arms([], [f"$\\nonsense$ {'a long name ' * 4}{n}: reference" for n in range(3)]), 1),
    ],
    ids=["default", "one", "eleven", "long names"],
)
def test_no_text_overlaps_another_or_leaves_the_figure(arms: list[Arm], seeds: int) -> None:
    require_legible(drawn(arms, seeds=seeds))


def test_default_arms_have_names_without_the_names_of_settings() -> None:
    figure = drawn(default_arms())
    names = [label.get_text().replace("\n", " ") for label in figure.axes[0].get_yticklabels()]
    assert "reference with one update per episode" in names
    assert "reference with no target network" in names
    assert "reference with truncated indices" in names
    assert not any("_" in name for name in names)
