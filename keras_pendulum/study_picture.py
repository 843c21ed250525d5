"""A study at a look: what each arm's regret is, and how it came about."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from keras_pendulum.environment import TASKS
from keras_pendulum.intervals import curve_band
from keras_pendulum.study_result import EPISODES_A_POINT, Result
from keras_pendulum.study_table import Row

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_Style = tuple[str, Any, str]  # colour, line, marker
# Okabe and Ito's colours, a brown for their yellow, which is faint on white; each with a line and a
# marker of its own: without colour these tell the arms apart.
STYLES: tuple[_Style, ...] = (
    ("black", "-", "s"),
    ("#0072B2", "-", "o"),
    ("#D55E00", "--", "^"),
    ("#009E73", "-.", "v"),
    ("#CC79A7", ":", "D"),
    ("#E69F00", (0, (5, 1, 1, 1, 1, 1)), "P"),
    ("#56B4E9", (0, (1, 1)), "X"),
    ("#8C510A", (0, (8, 2)), "*"),
)
_PLAIN: _Style = ("0.45", "-", "o")


def study_figure(rows: Sequence[Row], results: Mapping[str, Sequence[Result]]) -> bytes:
    """Left the arms' regrets as a ladder, right their learning curves, one panel for each task.

    Args:
        rows: at least one, from the first to the last rung.
        results: the runs by the arm's name.

    Returns:
        A PNG file's bytes.
    """
    from matplotlib.figure import Figure

    drawn = [row for row in rows if row.arm.curve]
    styles = {row.arm.name: _style(place) for place, row in enumerate(drawn)}
    tasks = list(dict.fromkeys(row.arm.task for row in drawn))
    # A panel needs 4 inches for its axis and its name, and a line for each curve in its legend.
    height = max(6.5, 1.5 + 0.55 * len(rows), 4.0 * len(tasks) + 0.2 * len(drawn))
    figure = Figure(figsize=(13, height), layout="constrained")
    grid = figure.add_gridspec(max(1, len(tasks)), 2, width_ratios=(1, 1.05))
    _draw_regrets(figure.add_subplot(grid[:, 0]), rows, styles)
    for i, task in enumerate(tasks):
        of_task = [row for row in drawn if row.arm.task == task]
        _draw_curves(figure.add_subplot(grid[i, 1]), of_task, results, styles)
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=100)
    return stream.getvalue()


def _style(place: int) -> _Style:
    """Each curve's own; where colours come again, they do so with another line and marker."""
    color, _, _ = STYLES[place % len(STYLES)]
    # By three, as each colour then gets a line that looks different from the one it had.
    _, line, marker = STYLES[(place + place // len(STYLES) * 3) % len(STYLES)]
    return color, line, marker


def _draw_regrets(axes: Axes, rows: Sequence[Row], styles: Mapping[str, _Style]) -> None:
    for place, row in enumerate(rows):
        color, _, marker = styles.get(row.arm.name, _PLAIN)
        axes.plot(row.regrets, [place + 0.22] * len(row.regrets), "|", color="0.6", markersize=7)
        axes.plot([row.regret.low, row.regret.high], [place] * 2, "-", color=color, linewidth=3)
        axes.plot(row.regret.value, place, marker, color=color, markersize=9)
        axes.annotate(
            f"{row.regret.value:.3g}" if row.regret.value < 1000 else f"{row.regret.value:.0f}",
            (max(row.regret.value, *row.regrets), place),
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
    results: Mapping[str, Sequence[Result]],
    styles: Mapping[str, _Style],
) -> None:
    task = TASKS[rows[0].arm.config.environment]
    for row in rows:
        color, line, marker = styles[row.arm.name]
        curves = [
            run.average_rewards if task.never_terminates else run.episode_returns
            for run in results[row.arm.name]
        ]
        middle, low, high = curve_band(curves)
        # Each point stands in the middle of its episodes; the last may have fewer.
        starts = np.arange(len(middle)) * EPISODES_A_POINT
        ends = np.minimum(starts + EPISODES_A_POINT, row.arm.config.episodes)
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
    axes.set(xlabel="Episode", title=f"{rows[0].arm.task}: means of {EPISODES_A_POINT} episodes")
    axes.title.set_fontsize("medium")
    # Below, where it covers no curve.
    axes.legend(
        loc="upper center",
        bbox_to_anchor=(0.5, 0),
        borderaxespad=4,  # in letters, however high the panel is: below the axis and its name
        ncols=1,
        fontsize="small",
        frameon=False,
        handlelength=4,
    )
    axes.grid(color="0.9")
