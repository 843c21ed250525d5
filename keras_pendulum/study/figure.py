"""The figure of a study: the regret of each arm, and its greedy regret while it learns."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.compare.curve_style import CurveStyle, curve_style
from keras_pendulum.environments.tasks import TASKS
from keras_pendulum.study.job import EPISODES_PER_POINT, RunResult, evaluate_every
from keras_pendulum.study.statistics import curve_band
from keras_pendulum.study.table import Row

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_STYLE_WITHOUT_CURVE: CurveStyle = ("0.45", "-", "o")
_LETTERS = 34  # of a line of an arm's name
_SMALLEST_REGRET = 0.01  # on a logarithmic axis


def draw_study(rows: Sequence[Row], results: Mapping[str, Sequence[RunResult]]) -> bytes:
    """Draws the arms' regrets on the left, and their curves on the right, a panel for each task.

    A curve is the greedy regret over the episodes. The results of older versions have none; their
    arms get the learning curve, where no arm of the task has regrets.

    Args:
        rows: at least one, from top to bottom.
        results: the runs by the arm's name.

    Returns:
        A PNG file's bytes.
    """
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    with_curve = [row for row in rows if row.arm.has_curve]
    styles = {row.arm.name: curve_style(index) for index, row in enumerate(with_curve)}
    tasks = list(dict.fromkeys(row.arm.task for row in with_curve))
    with rc_context({"font.size": 12}):
        # A panel needs 4 inches, a row half an inch, and three names a line of the legend.
        legend = 0.3 * (1 + len(with_curve) // 2)
        figure = Figure(
            figsize=(14, max(6.0, 1.5 + 0.62 * len(rows), 4.0 * len(tasks)) + legend),
            layout="constrained",
        )
        grid = figure.add_gridspec(max(1, len(tasks)), 2, width_ratios=(1, 1.05))
        _draw_regrets(figure.add_subplot(grid[:, 0]), rows, styles)
        for i, task in enumerate(tasks):
            task_rows = [row for row in with_curve if row.arm.task == task]
            _draw_curves(figure.add_subplot(grid[i, 1]), task_rows, results, styles)
        lines = [line for axes in figure.axes[1:] for line in axes.lines]
        # Below both panels, where it covers no curve and has the whole width.
        figure.legend(
            lines,
            [str(line.get_label()) for line in lines],
            loc="outside lower center",
            ncols=2,
            frameon=False,
            handlelength=4,
        )
        stream = io.BytesIO()
        figure.savefig(stream, format="png", dpi=100)
    return stream.getvalue()


def _draw_regrets(axes: Axes, rows: Sequence[Row], styles: Mapping[str, CurveStyle]) -> None:
    for y, row in enumerate(rows):
        color, _, marker = styles.get(row.arm.name, _STYLE_WITHOUT_CURVE)
        axes.plot(row.regrets, [y + 0.25] * len(row.regrets), "|", color="0.5", markersize=7)
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
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_formatter("")
    axes.margins(x=0.25)
    axes.set_yticks(range(len(rows)), [_wrap(row.arm.shown_name) for row in rows])
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.grid(axis="x", color="0.9")
    axes.set_axisbelow(True)
    axes.set_xlabel("Regret after the run (return below the best possible)")
    runs = max(len(row.regrets) for row in rows)
    title = "Each tick is a run" if runs == 1 else "Mean of the middle half of the runs,"
    title += "" if runs == 1 else "\n95 % bootstrap interval; each tick below is a run"
    axes.set_title(title, fontsize="medium")


def _draw_curves(
    axes: Axes,
    rows: Sequence[Row],
    results: Mapping[str, Sequence[RunResult]],
    styles: Mapping[str, CurveStyle],
) -> None:
    """Draws the greedy regrets of the arms of a task, or where no run has any, what it earned."""
    task = TASKS[rows[0].arm.config.environment]
    evaluated = {
        row.arm.name: [run.greedy_regrets for run in results[row.arm.name] if run.greedy_regrets]
        for row in rows
    }
    has_regrets = any(evaluated.values())
    for index, row in enumerate(rows):
        if has_regrets:
            curves = evaluated[row.arm.name]
            if not curves:
                continue
            every = evaluate_every(row.arm.config)
            episodes = every * (1.0 + np.arange(len(curves[0])))
        else:
            curves = [
                run.average_rewards if task.never_terminates else run.episode_returns
                for run in results[row.arm.name]
            ]
            episodes = _middles(len(curves[0]), row.arm.config.episodes)
        middle, low, high = curve_band(curves)
        color, line, marker = styles[row.arm.name]
        between = max(1, len(middle) // 8)
        axes.plot(
            episodes,
            middle,
            color=color,
            linestyle=line,
            linewidth=1.8,
            marker=marker,
            # Each curve starts its markers elsewhere, so that they do not cover each other.
            markevery=(between * index // len(rows), between),
            label=row.arm.shown_name,
        )
        axes.fill_between(episodes, low, high, color=color, alpha=0.15, linewidth=0)
    kind = "the greedy policy while learning" if has_regrets else "what each arm earned"
    axes.set_title(f"{rows[0].arm.task}: {kind}", fontsize="medium")
    if has_regrets:
        _scale_regrets(axes)
    elif task.never_terminates:
        axes.set_ylabel(f"Reward per step, means of {EPISODES_PER_POINT} episodes")
    else:
        axes.set_ylabel(f"Return (steps), means of {EPISODES_PER_POINT} episodes")
    axes.set_xlabel("Episode")
    axes.grid(color="0.9")


def _middles(points: int, episodes: int) -> NDArray[np.float64]:
    """Returns the middle episode of each point; the last point may have fewer episodes."""
    starts = np.arange(points) * EPISODES_PER_POINT
    ends = np.minimum(starts + EPISODES_PER_POINT, episodes)
    return np.asarray((starts + ends - 1) / 2)


def _scale_regrets(axes: Axes) -> None:
    """Makes the axis of the regrets logarithmic, around 0 linear where a regret is near 0."""
    lowest = min(float(np.min(line.get_ydata())) for line in axes.lines)
    if lowest > _SMALLEST_REGRET:
        axes.set_yscale("log")
    else:
        axes.set_yscale("symlog", linthresh=1)
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter("")
    axes.set_ylabel("Greedy regret (return below the best possible)")


def _wrap(name: str) -> str:
    return textwrap.fill(name, _LETTERS, break_on_hyphens=False).replace("$", r"\$")
