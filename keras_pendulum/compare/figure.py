"""The figure of compared runs: their learning curves and the regrets of their greedy policies."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING

from keras_pendulum.compare.curve_style import CurveStyle, curve_style
from keras_pendulum.compare.runs import ComparedRun
from keras_pendulum.environments.tasks import TASKS
from keras_pendulum.errors import one_line
from keras_pendulum.evaluate.score import Score
from keras_pendulum.train.learning_curve import trailing_mean

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D

_MEAN_OVER = 10  # episodes; fewer at the start of a run
_MARKERS = 8  # on each curve


def draw_comparison(runs: Sequence[ComparedRun], optimum: float | None) -> bytes:
    """Returns a PNG with the learning curves on the left and the greedy regrets on the right.

    Args:
        runs: at least one, all of the same task.
        optimum: the best possible value of the curves; None draws no line for it.
    """
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    names = [_label(run.name) for run in runs]
    styles = [curve_style(index + 1) for index in range(len(runs))]  # the optimum is black
    with rc_context({"font.size": 12}):
        # Each run needs a row of the regrets, and a third of a row of the legend.
        height = max(4.6, 1.2 + 0.5 * len(runs)) + 0.1 * len(runs)
        figure = Figure(figsize=(12, height), layout="constrained")
        curves, regrets = figure.subplots(1, 2, width_ratios=(1.1, 1))
        lines = _draw_curves(curves, runs, styles)
        if optimum is not None:
            lines.append(curves.axhline(optimum, color="black", linestyle="--"))
        # Below the axes, where the legend covers no curve. Without the optimum, the last name is
        # left out.
        figure.legend(
            lines,
            [*names, "best possible"][: len(lines)],
            loc="outside lower center",
            ncols=3,
            frameon=False,
            handlelength=4,
        )
        _draw_regrets(regrets, [run.score for run in runs], names, styles)
        stream = io.BytesIO()
        figure.savefig(stream, format="png", dpi=100)
    return stream.getvalue()


def _draw_curves(
    axes: Axes, runs: Sequence[ComparedRun], styles: Sequence[CurveStyle]
) -> list[Line2D]:
    """Draws the learning curves; returns their lines."""
    from matplotlib.ticker import EngFormatter, MaxNLocator

    task = TASKS[runs[0].config.environment]
    lines: list[Line2D] = []
    for index, (run, (color, line, marker)) in enumerate(zip(runs, styles, strict=True)):
        values = [
            record.average_reward if task.never_terminates else record.episode_return
            for record in run.history
        ]
        between = max(1, len(values) // _MARKERS)
        lines += axes.plot(
            [record.environment_steps for record in run.history],
            trailing_mean(values, _MEAN_OVER),
            color=color,
            linestyle=line,
            linewidth=1.7,
            marker=marker,
            # Each curve starts its markers elsewhere, so that they do not cover each other.
            markevery=(between * index // len(runs), between),
        )
    axes.xaxis.set_major_locator(MaxNLocator(5))
    axes.xaxis.set_major_formatter(EngFormatter())
    axes.set_xlabel("Environment steps")
    axes.set_ylabel("Average reward per step" if task.never_terminates else "Return (steps)")
    axes.set_title(f"While learning, mean of {_MEAN_OVER} episodes", fontsize="medium")
    axes.grid(color="0.9")
    return lines


def _draw_regrets(
    axes: Axes, scores: Sequence[Score], names: Sequence[str], styles: Sequence[CurveStyle]
) -> None:
    regrets = [score.regret for score in scores]
    for y, (regret, (color, _, marker)) in enumerate(zip(regrets, styles, strict=True)):
        axes.plot(regret, y, marker, color=color, markersize=10)
        text = f"{regret:.3g}" if regret < 1000 else f"{regret:.0f}"
        axes.annotate(text, (regret, y), xytext=(10, 0), textcoords="offset points", va="center")
    low, high = min(0.0, *regrets), max(1.0, *regrets)
    if high > 20 * max(1.0, min(regrets)):  # on a linear scale the small ones would look equal
        axes.set_xscale("symlog", linthresh=1)
        axes.xaxis.set_major_formatter("{x:g}")
        axes.set_xlim(1.5 * low - 0.2, 2 * high**1.3)  # leaves room for the number of the largest
    else:
        axes.set_xlim(low - 0.05 * (high - low), high + 0.3 * (high - low))
    axes.axvline(0, color="black", linestyle="--")
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.grid(axis="x", color="0.9")
    axes.set_axisbelow(True)
    axes.set_xlabel("Regret (return below the best possible)")
    starts = len(scores[0].returns)
    axes.set_title(f"Greedy policy on {starts} fixed starts", fontsize="medium")


def _label(name: str) -> str:
    """Returns a name in at most two lines of 30 letters, as Matplotlib draws it."""
    name = one_line(name)
    if len(name) > 60:
        name = f"{name[:29]}…{name[-30:]}"
    # A dollar sign would start a formula.
    return textwrap.fill(name, 30).replace("$", r"\$")
