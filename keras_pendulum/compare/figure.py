"""The figure of compared runs: their learning curves and the regrets of their greedy policies."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from keras_pendulum.compare.runs import ComparedRun
from keras_pendulum.errors import one_line
from keras_pendulum.figures.curves import curve_styles, draw_legend_below, draw_marked_curve
from keras_pendulum.figures.learning_curve import (
    MEAN_OVER,
    OPTIMUM,
    curve_values,
    trailing_mean,
)
from keras_pendulum.figures.regrets import RegretRow, draw_regrets
from keras_pendulum.figures.style import own_style, plain_text, png

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw_comparison(runs: Sequence[ComparedRun], optimum: float | None) -> bytes:
    """Returns a PNG with the learning curves on the left and the greedy regrets on the right.

    There is at least one run, and all are of the same task. The optimum is the best possible value
    of the curves; None draws no line for it.
    """
    from matplotlib.figure import Figure

    styles = curve_styles([run.config.preset for run in runs])
    rows = [
        RegretRow(name, run.score.regret, style)
        for name, run, style in zip(_row_names(runs), runs, styles, strict=True)
    ]
    with own_style():
        # Each run needs a row of the regrets, and a third of a row of the legend.
        height = max(4.6, 1.2 + 0.5 * len(runs)) + 0.1 * len(runs)
        figure = Figure(figsize=(12, height), layout="constrained")
        curves, regrets = figure.subplots(1, 2, width_ratios=(1.1, 1))
        _draw_curves(curves, runs, rows)
        if optimum is not None:
            curves.axhline(optimum, color="black", linestyle="--", label=OPTIMUM)
        draw_legend_below(figure, [curves], columns=3)
        starts = len(runs[0].score.returns)
        title = f"Greedy policy on {starts} fixed starts"
        draw_regrets(regrets, rows, "Regret (return below the best possible)", title)
        return png(figure)


def _draw_curves(axes: Axes, runs: Sequence[ComparedRun], rows: Sequence[RegretRow]) -> None:
    from matplotlib.ticker import EngFormatter, MaxNLocator

    task = runs[0].config.task
    for index, (run, row) in enumerate(zip(runs, rows, strict=True)):
        steps = [record.environment_steps for record in run.history]
        means = trailing_mean(curve_values(run.history, task))
        draw_marked_curve(axes, steps, means, row.style, index / len(runs), row.name)
    axes.xaxis.set_major_locator(MaxNLocator(5))
    axes.xaxis.set_major_formatter(EngFormatter())
    axes.set(xlabel="Environment steps", ylabel=task.curve_label)
    axes.set_title(f"While learning, mean of {MEAN_OVER} episodes")
    axes.grid(color="0.9")


def _row_names(runs: Sequence[ComparedRun]) -> list[str]:
    """Returns short names; where the runs are of different lengths, with their steps."""
    names = [_short_name(run.name) for run in runs]
    steps = [run.history[-1].environment_steps for run in runs]
    if len(set(steps)) == 1:
        return names
    return [f"{name}\nafter {n:,} steps" for name, n in zip(names, steps, strict=True)]


def _short_name(name: str) -> str:
    """Returns a name in about two lines."""
    name = one_line(name)
    if len(name) > 60:
        name = f"{name[:29]}…{name[-30:]}"
    return plain_text(name, letters=30)
