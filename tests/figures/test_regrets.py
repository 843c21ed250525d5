from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from keras_pendulum.figures.curves import STYLES, curve_style
from keras_pendulum.figures.regrets import RegretRow, draw_regrets


def test_24_curves_have_different_styles_and_neighbours_different_lines() -> None:
    styles = [curve_style(index) for index in range(24)]
    assert len({(color, line) for color, line, _ in styles}) == 24
    assert len({(color, marker) for color, _, marker in styles}) == 24
    assert styles[: len(STYLES)] == list(STYLES)


def test_row_shows_the_regret_its_interval_and_its_runs() -> None:
    axes = Figure().subplots()
    runs = [1.0, 2.5, 4.0]
    rows = [
        RegretRow("one", 2.0, curve_style(0), runs, (1.5, 3.0)),
        RegretRow("two", 1234.5, curve_style(1)),
    ]
    draw_regrets(axes, rows, "Regret", "title")
    regret, interval, ticks = (np.asarray(line.get_xdata()).tolist() for line in axes.lines[:3])
    assert (regret, interval, ticks) == ([2.0], [1.5, 3.0], runs)
    assert [(text.get_text(), text.xy) for text in axes.texts] == [  # type: ignore[attr-defined]
        ("2", (4.0, 0)),  # to the right of all ticks
        ("1234", (1234.5, 1)),
    ]
    low, high = axes.get_ylim()
    assert low > high  # the first row is the uppermost


@pytest.mark.parametrize(
    ("regrets", "scale"),
    [
        ([0.0, 0.0], "linear"),
        ([1.2, 20.0], "linear"),
        ([500.0, 900.0], "linear"),
        ([0.0, 21.0], "symlog"),
        ([-5.0, 1200.0], "symlog"),
    ],
)
def test_scale_tells_small_regrets_apart_and_shows_the_best_possible(
    regrets: list[float], scale: str
) -> None:
    axes = Figure().subplots()
    rows = [RegretRow(f"{regret}", regret, curve_style(0)) for regret in regrets]
    draw_regrets(axes, rows, "Regret", "title")
    assert axes.get_xscale() == scale
    low, high = axes.get_xlim()
    assert low < min(0.0, *regrets) <= max(regrets) < high
