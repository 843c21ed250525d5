"""The figure of compared runs: the right numbers, and no text that covers another."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
import pytest
from figure_texts import figure_of, require_legible
from matplotlib.figure import Figure

import keras_pendulum as kp
from keras_pendulum.compare.figure import draw_comparison
from keras_pendulum.compare.runs import ComparedRun, best_possible
from keras_pendulum.history import EpisodeRecord


def make_runs(
    regrets: Sequence[float], names: Sequence[str] = (), preset: str = "reference"
) -> list[ComparedRun]:
    """Returns runs of 40 episodes; episode i of the run n has the average reward -i - n."""
    config = kp.preset(preset)
    return [
        ComparedRun(
            names[n] if names else f"run{n}",
            config,
            [
                EpisodeRecord(i, -i - n, 100.0 + i, 0.5, math.nan, 200 * (i + 1), i, 0.1)
                for i in range(40)
            ],
            kp.Score(config.task, np.array([-regret]), np.array([0.0])),
        )
        for n, regret in enumerate(regrets)
    ]


def drawn(runs: Sequence[ComparedRun], optimum: float | None) -> Figure:
    return figure_of(lambda: draw_comparison(runs, optimum))


def test_curves_are_the_means_over_the_last_10_episodes() -> None:
    curves, regrets = drawn(make_runs([1.0, 2.0]), -0.2).axes
    for n, line in enumerate(curves.lines[:2]):
        assert np.asarray(line.get_xdata()).tolist() == [200 * (i + 1) for i in range(40)]
        assert np.asarray(line.get_ydata())[[0, 1, 39]].tolist() == [-n, -0.5 - n, -34.5 - n]
    assert np.asarray(curves.lines[2].get_ydata()).tolist() == [-0.2, -0.2]
    assert [text.get_text() for text in regrets.texts] == ["1", "2"]


def test_curve_of_cartpole_shows_returns() -> None:
    curves = drawn(make_runs([1.0], preset="cartpole"), 500.0).axes[0]
    assert np.asarray(curves.lines[0].get_ydata())[1] == 100.5
    assert curves.get_ylabel() == "Return (steps)"


def test_runs_of_different_lengths_have_their_steps_in_their_names() -> None:
    long, short = make_runs([1.0, 2.0], [f"{'a long name, ' * 4}{n}" for n in range(2)])
    short = dataclasses.replace(short, history=short.history[:15])
    figure = drawn([long, short], -0.2)
    require_legible(figure)
    names = [text.get_text() for text in figure.axes[1].get_yticklabels()]
    assert [name.splitlines()[-1] for name in names] == ["after 8,000 steps", "after 3,000 steps"]
    same = drawn(make_runs([1.0, 2.0]), -0.2)
    assert [text.get_text() for text in same.axes[1].get_yticklabels()] == ["run0", "run1"]


def test_preset_has_the_same_colour_in_every_comparison() -> None:
    def colours(*presets: str) -> list[str]:
        runs = [make_runs([1.0], preset=preset)[0] for preset in presets]
        return [str(line.get_color()) for line in drawn(runs, -0.2).axes[0].lines[:-1]]

    original, reference, swingup = colours("original", "reference", "swingup")
    assert len({original, reference, swingup, "black"}) == 4
    assert colours("swingup", "original") == [swingup, original]
    assert colours("reference", "reference", "swingup")[::2] == [reference, swingup]
    assert len(set(colours(*["reference"] * 7))) == 7


@pytest.mark.parametrize(
    ("regrets", "optimum"),
    [
        ([1.87], -0.2),
        ([0.0, 0.0], None),
        ([1.87, 8.2, 986.6, 1753.1], -0.2),
        ([-5.0, 1200.0], None),
        ([float(n) for n in range(20)], -0.2),
    ],
    ids=str,
)
@pytest.mark.parametrize("name", ["run", "a very long name of a run, longer than two lines of it "])
def test_no_text_covers_another_or_leaves_the_picture(
    regrets: list[float], optimum: float | None, name: str
) -> None:
    runs = make_runs(regrets, [f"{name}{n}" for n in range(len(regrets))])
    figure = drawn(runs, optimum)
    require_legible(figure)
    _, regret_axes = figure.axes
    legend = figure.legends[0].get_texts()
    assert len(legend) == len(runs) + (optimum is not None)
    for number in regret_axes.texts:
        assert number.get_window_extent().x1 <= regret_axes.bbox.x1


def test_names_are_drawn_letter_by_letter() -> None:
    # Matplotlib would refuse the second one as a formula.
    names = ["_hidden", r"$\nonsense$", "100 % & \\n", "größe θ"]
    figure = drawn(make_runs([1.0] * 4, names), None)
    shown = [text.get_text().replace(r"\$", "$") for text in figure.legends[0].get_texts()]
    assert shown == names


def test_optimum_is_on_the_scale_of_the_curves() -> None:
    (run,) = make_runs([1.0])
    found = best_possible([run])
    steps = run.config.max_episode_steps
    optimum = kp.optimal_return(1.0, range(1000), steps).mean() / steps
    assert found == pytest.approx(float(optimum))
    (pole,) = make_runs([1.0], preset="cartpole")
    assert best_possible([pole]) == 500.0
    (short,) = make_runs([1.0], preset="swingup")
    assert best_possible([run, short]) is None
    config = kp.preset("reference", max_episode_steps=300)
    assert best_possible([ComparedRun("long", config, run.history, run.score)]) is None
