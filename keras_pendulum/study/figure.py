"""The figure of a study: the regret of each arm, and its greedy regret while it learns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from keras_pendulum.figures.curves import (
    CurveStyle,
    curve_styles,
    draw_legend_below,
    draw_marked_curve,
)
from keras_pendulum.figures.regrets import (
    RegretRow,
    draw_random_regret,
    draw_regrets,
    scale_greedy_regrets,
)
from keras_pendulum.figures.style import own_style, plain_text, png
from keras_pendulum.study.job import RunResult, evaluate_every
from keras_pendulum.study.statistics import curve_band
from keras_pendulum.study.table import Row

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MOST_BANDS = 3  # in a panel; more curves have an interval at their end only
_STYLE_WITHOUT_CURVE: CurveStyle = ("0.45", "-", "o")


def draw_study(rows: Sequence[Row], results: Mapping[str, Sequence[RunResult]]) -> bytes:
    """Returns a PNG with the arms' regrets on the left, and their curves on the right.

    The curves have a panel for each task. A curve is the greedy regret over the episodes. A dotted
    line is that of random actions. There is at least one row; the results are by the arm's name.
    """
    from matplotlib.figure import Figure

    with_curve = [row for row in rows if row.arm.has_curve]
    names = [row.arm.name for row in with_curve]
    styles = dict(zip(names, curve_styles(names), strict=True))
    tasks = list(dict.fromkeys(row.arm.task for row in with_curve))
    with own_style():
        # A panel needs 4 inches, a row half an inch, and three names a line of the legend.
        legend = 0.3 * (1 + len(with_curve) // 2)
        figure = Figure(
            figsize=(14, max(6.0, 1.5 + 0.62 * len(rows), 4.0 * len(tasks)) + legend),
            layout="constrained",
        )
        grid = figure.add_gridspec(max(1, len(tasks)), 2, width_ratios=(1, 1.05))
        _draw_arms(figure.add_subplot(grid[:, 0]), rows, styles)
        panels = [figure.add_subplot(grid[i, 1]) for i in range(len(tasks))]
        for axes, task in zip(panels, tasks, strict=True):
            task_rows = [row for row in with_curve if row.arm.task == task]
            _draw_curves(axes, task_rows, results, styles)
        draw_legend_below(figure, panels, columns=2)
        return png(figure)


def _draw_arms(axes: Axes, rows: Sequence[Row], styles: Mapping[str, CurveStyle]) -> None:
    shown = [
        RegretRow(
            plain_text(row.arm.label or row.arm.name, letters=34),
            row.regret.value,
            styles.get(row.arm.name, _STYLE_WITHOUT_CURVE),
            row.regrets,
            (row.regret.low, row.regret.high),
        )
        for row in rows
    ]
    title = "Each tick is a run"
    if max(len(row.regrets) for row in rows) > 1:
        title = (
            "Mean of the middle half of the runs,\n"
            "95 % bootstrap interval; each tick below is a run"
        )
    draw_regrets(axes, shown, "Regret after the run (return below the best possible)", title)


def _draw_curves(
    axes: Axes,
    rows: Sequence[Row],
    results: Mapping[str, Sequence[RunResult]],
    styles: Mapping[str, CurveStyle],
) -> None:
    """Draws the greedy regrets of the arms of a task."""
    for index, row in enumerate(rows):
        middle, low, high = curve_band([run.greedy_regrets for run in results[row.arm.name]])
        episodes = evaluate_every(row.arm.config) * (1.0 + np.arange(len(middle)))
        style = styles[row.arm.name]
        label = plain_text(row.arm.label or row.arm.name, letters=80)
        draw_marked_curve(axes, episodes, middle, style, index / len(rows), label)
        if len(rows) <= _MOST_BANDS:
            axes.fill_between(episodes, low, high, color=style[0], alpha=0.15, linewidth=0)
        else:  # beside each other, behind the last evaluation
            end = episodes[-1] * (1.02 + 0.06 * index / len(rows))
            axes.vlines(end, low[-1], high[-1], color=style[0], linewidth=2.5)
    scale_greedy_regrets(axes)
    draw_random_regret(axes, rows[0].arm.config.task)
    axes.set(
        xlabel="Episode",
        ylabel="Greedy regret (return below the best possible)",
        title=f"{rows[0].arm.task}: the greedy policy while learning",
    )
    axes.grid(color="0.9")
