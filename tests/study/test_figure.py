"""The figure of a study: each arm has its own curve, and all labels are visible."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from keras_pendulum.study.arms import own_arms
from keras_pendulum.study.figure import draw_study
from keras_pendulum.study.job import RunResult
from keras_pendulum.study.table import make_rows


def panels(
    presets: list[str], arms: list[str], monkeypatch: pytest.MonkeyPatch
) -> dict[str, dict[str, Line2D]]:
    """Returns the curves by task and arm; the n-th arm (from 0) has the values n and n + 0.5."""
    shown: list[Axes] = []
    monkeypatch.setattr(Figure, "savefig", lambda self, *args, **named: shown.extend(self.axes))
    compared = own_arms(presets, arms)
    results = {
        arm.name: [RunResult(0.0, [-9.0], [n, n + 0.5], [n, n + 0.5])]
        for n, arm in enumerate(compared)
    }
    draw_study(make_rows(compared, results), results)
    return {
        axes.get_title().split(":")[0]: {str(line.get_label()): line for line in axes.lines}
        for axes in shown[1:]
    }


def test_each_arm_draws_its_own_curve(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn = panels(["reference", "original", "cartpole"], [], monkeypatch)
    values = {
        task: {name: np.asarray(line.get_ydata()).tolist() for name, line in lines.items()}
        for task, lines in drawn.items()
    }
    assert values == {
        "Pendulum-v1, g = 1": {"reference": [0, 0.5], "original": [1, 1.5]},
        "CartPole-v1": {"cartpole": [2, 2.5]},
    }


def test_more_arms_than_colours_have_different_curves(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    many = [f"arm{n}: reference" for n in range(12)]
    drawn = panels([], [*many, "pole: cartpole"], monkeypatch)
    assert [len(lines) for lines in drawn.values()] == [12, 1]
    lines = [line for panel in drawn.values() for line in panel.values()]
    assert len({(line.get_color(), line.get_marker()) for line in lines}) == 13


def test_axis_labels_are_visible_beside_long_legends(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    many = [f"arm{n}: reference" for n in range(10)]
    drawn = panels([], [*many, "pole: cartpole"], monkeypatch)
    for lines in drawn.values():
        axes = next(iter(lines.values())).axes
        assert axes is not None
        figure = axes.get_figure(root=True)
        assert figure is not None
        figure.draw_without_rendering()
        name = axes.yaxis.label.get_window_extent()
        assert 0 < name.y0 < name.y1 < figure.bbox.y1
