"""Panels of regrets: a row for each run or arm, and the scale of regrets while learning."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from keras_pendulum.environments.task import Task
from keras_pendulum.figures.curves import CurveStyle
from keras_pendulum.figures.learning_curve import RANDOM
from keras_pendulum.optimum.solutions import solution

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True)
class RegretRow:
    """A regret as a marker with its number."""

    name: str  # as Matplotlib draws it
    regret: float
    style: CurveStyle
    runs: Sequence[float] = ()  # regrets to draw as ticks below
    interval: tuple[float, ...] = ()  # its ends, to draw as a line


def draw_regrets(axes: Axes, rows: Sequence[RegretRow], label: str, title: str) -> None:
    """Draws regrets from top to bottom; a dashed line is the best possible.

    Args:
        axes: to draw on.
        rows: at least one.
        label: of the axis.
        title: of the panel.
    """
    shown: list[float] = []
    for y, row in enumerate(rows):
        color, _, marker = row.style
        axes.plot(row.regret, y, marker, color=color, markersize=9)
        axes.plot(row.interval, [y] * len(row.interval), "-", color=color, linewidth=3)
        axes.plot(row.runs, [y + 0.25] * len(row.runs), "|", color="0.5", markersize=7)
        text = f"{row.regret:.3g}" if row.regret < 1000 else f"{row.regret:.0f}"
        place = (max([row.regret, *row.runs]), y)
        axes.annotate(text, place, xytext=(9, 0), textcoords="offset points", va="center")
        shown += [row.regret, *row.interval, *row.runs]
    low, high = min(0.0, *shown), max(1.0, *shown)
    if high > 20 * max(1.0, min(shown)):  # on a linear scale the small ones would look equal
        axes.set_xscale("symlog", linthresh=1)
        axes.xaxis.set_major_formatter("{x:g}")
        axes.set_xlim(1.5 * low - 0.2, 2 * high**1.3)  # leaves room for the number of the largest
    else:
        axes.set_xlim(low - 0.05 * (high - low), high + 0.3 * (high - low))
    axes.axvline(0, color="black", linestyle="--")
    axes.set_yticks(range(len(rows)), [row.name for row in rows])
    axes.set_ylim(len(rows) - 0.5, -0.5)
    axes.grid(axis="x", color="0.9")
    axes.set_axisbelow(True)
    axes.set(xlabel=label, title=title)


def draw_random_regret(axes: Axes, task: Task) -> None:
    """Draws a dotted line at the regret of random actions in whole episodes."""
    exact = solution(task)
    regret = exact.mean_best_return(task.steps_per_episode) - exact.random_return()
    axes.axhline(regret, color="0.3", linestyle=":", linewidth=1.5, label=RANDOM)


def scale_greedy_regrets(axes: Axes) -> None:
    """Makes the axis of the regrets while learning logarithmic from 1 on.

    Below 1 it is linear, because a regret can be 0.
    """
    axes.set_yscale("symlog", linthresh=1)
    axes.yaxis.set_major_formatter("{x:g}")
