"""The figure of a study: the regret of each arm, and its learning curve."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from keras_pendulum.compare.curve_style import CurveStyle, curve_style
from keras_pendulum.environments.tasks import TASKS
from keras_pendulum.study.job import EPISODES_PER_POINT, RunResult
from keras_pendulum.study.statistics import curve_band
from keras_pendulum.study.table import Row

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_STYLE_WITHOUT_CURVE: CurveStyle = ("0.45", "-", "o")


def draw_study(rows: Sequence[Row], results: Mapping[str, Sequence[RunResult]]) -> bytes:
    """Draws the arms' regrets on the left, and learning curves on the right, a panel for each task.

    Args:
        rows: at least one, from top to bottom.
        results: the runs by the arm's name.

    Returns:
        A PNG file's bytes.
    """
    from matplotlib.figure import Figure

    with_curve = [row for row in rows if row.arm.has_curve]
    styles = {row.arm.name: curve_style(index) for index, row in enumerate(with_curve)}
    tasks = list(dict.fromkeys(row.arm.task for row in with_curve))
    # A panel needs 4 inches for its axes and title, and a line for each curve in its legend.
    height = max(6.5, 1.5 + 0.55 * len(rows), 4.0 * len(tasks) + 0.2 * len(with_curve))
    figure = Figure(figsize=(13, height), layout="constrained")
    grid = figure.add_gridspec(max(1, len(tasks)), 2, width_ratios=(1, 1.05))
    _draw_regrets(figure.add_subplot(grid[:, 0]), rows, styles)
    for i, task in enumerate(tasks):
        task_rows = [row for row in with_curve if row.arm.task == task]
        _draw_curves(figure.add_subplot(grid[i, 1]), task_rows, results, styles)
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=100)
    return stream.getvalue()


def _draw_regrets(axes: Axes, rows: Sequence[Row], styles: Mapping[str, CurveStyle]) -> None:
    for y, row in enumerate(rows):
        color, _, marker = styles.get(row.arm.name, _STYLE_WITHOUT_CURVE)
        axes.plot(row.regrets, [y + 0.22] * len(row.regrets), "|", color="0.6", markersize=7)
        axes.plot([row.regret.low, row.regret.high], [y] * 2, "-", color=color, linewidth=3)
        axes.plot(row.regret.value, y, marker, color=color, markersize=9)
        axes.annotate(
            f"{row.regret.value:.3g}" if row.regret.value < 1000 else f"{row.regret.value:.0f}",
            (max(row.regret.value, *row.regrets), y),
            xytext=(9, 0),
            textcoords="offset points",
            va="center",
        )
    if all(min(row.regrets) > 0 for row in rows):
        axes.set_xscale("log")
    else:
        axes.set_xscale("symlog", linthresh=1)
    axes.margins(x=0.2)
    names = [textwrap.fill(row.arm.name, 36, break_on_hyphens=False) for row in rows]
    axes.set_yticks(range(len(rows)), names)
    axes.set_ylim(len(rows) - 0.5, -0.6)
    axes.grid(axis="x", color="0.9")
    axes.set_axisbelow(True)
    axes.set_xlabel("Regret (best possible return minus achieved)")
    axes.set_title(
        "Interquartile mean, 95 % bootstrap interval; ticks below: runs", fontsize="medium"
    )


def _draw_curves(
    axes: Axes,
    rows: Sequence[Row],
    results: Mapping[str, Sequence[RunResult]],
    styles: Mapping[str, CurveStyle],
) -> None:
    task = TASKS[rows[0].arm.config.environment]
    for row in rows:
        color, line, marker = styles[row.arm.name]
        curves = [
            run.average_rewards if task.never_terminates else run.episode_returns
            for run in results[row.arm.name]
        ]
        middle, low, high = curve_band(curves)
        # Each point is drawn in the middle of its episodes; the last point may have fewer.
        starts = np.arange(len(middle)) * EPISODES_PER_POINT
        ends = np.minimum(starts + EPISODES_PER_POINT, row.arm.config.episodes)
        episodes = (starts + ends - 1) / 2
        axes.plot(
            episodes,
            middle,
            color=color,
            linestyle=line,
            linewidth=1.7,
            marker=marker,
            markevery=max(1, len(middle) // 8),
            label=row.arm.name,
        )
        axes.fill_between(episodes, low, high, color=color, alpha=0.18, linewidth=0)
    if task.never_terminates:
        axes.set_ylabel("Average reward per step while learning")
    else:
        axes.set_ylabel("Return (steps) while learning")
    axes.set(xlabel="Episode", title=f"{rows[0].arm.task}: means of {EPISODES_PER_POINT} episodes")
    axes.title.set_fontsize("medium")
    # Below the axes, where the legend covers no curve.
    axes.legend(
        loc="upper center",
        bbox_to_anchor=(0.5, 0),
        borderaxespad=4,  # in letters: below the axis labels, whatever the height of the panel
        ncols=1,
        fontsize="small",
        frameon=False,
        handlelength=4,
    )
    axes.grid(color="0.9")
