"""Figures of a run: its learning curve, greedy regret, ε, loss and phase planes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from keras_pendulum.figures.learning_curve import CURVE, draw_episode_axis, draw_learning_curve
from keras_pendulum.figures.phase_planes import BETWEEN, ROW, draw_planes
from keras_pendulum.figures.regrets import scale_greedy_regrets
from keras_pendulum.figures.style import own_style, png
from keras_pendulum.optimum.phase_plane import PhasePlane

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.gridspec import GridSpec

    from keras_pendulum.environments.task import Task
    from keras_pendulum.history import EpisodeRecord

_WIDTH = 9.6  # inches, as all that follow
_LIVE_HEIGHT = 5.4
_LEGEND = 0.5  # two lines, above the first row
_TITLE = 0.8
_SMALLEST_DECIMAL = 1e-4  # of the numbers at an axis


def draw_run(
    history: Sequence[EpisodeRecord],
    task: Task,
    reference_returns: Mapping[str, float],
    planes: Mapping[str, PhasePlane],
    title: str = "",
) -> bytes:
    """Returns a PNG with the learning curve of a run, its ε, its loss, and phase planes.

    The curve shows the average reward per step; for CartPole it shows the return. A run that was
    evaluated has one more curve, its greedy regret.

    Args:
        history: at least one record.
        task: of the run.
        reference_returns: mean returns of an episode of the same length, by name: `best possible`,
            `random actions` or others. Each becomes a horizontal line.
        planes: phase planes to draw side by side, by name; may be empty.
        title: of the figure; its first line is the larger one.
    """
    evaluated = [record for record in history if not math.isnan(record.greedy_regret)]
    row = 2 if evaluated else 1  # of ε and loss
    rows = row + (3 if planes else 1)
    with own_style():
        figure, grid = _figure_with_grid(rows, 2, top=_LEGEND + (_TITLE if title else 0.1))
        _draw_title(figure, title)
        axes = figure.add_subplot(grid[0, :])
        draw_learning_curve(axes, history, task, reference_returns)
        epsilon, loss = figure.add_subplot(grid[row, 0]), figure.add_subplot(grid[row, 1])
        _draw_epsilon(epsilon, history)
        _draw_loss(loss, history)
        if evaluated:
            axes = figure.add_subplot(grid[1, :])
            _draw_greedy_regret(axes, evaluated)
            draw_episode_axis(axes, len(history))
        if planes:
            draw_planes(figure, grid[row + 1 :, :], planes)
        return png(figure)


def draw_live(
    history: Sequence[EpisodeRecord],
    task: Task,
    reference_returns: Mapping[str, float],
    title: str,
    episodes: int,
) -> bytes:
    """Returns a PNG with the learning curve of the episodes so far, and their ε.

    Args: those of `draw_run`, and the number of all episodes, which the axes span.
    """
    from matplotlib.figure import Figure

    with own_style():
        figure = Figure(figsize=(_WIDTH, _LIVE_HEIGHT))
        _draw_title(figure, title)
        curve, epsilon = figure.subplots(
            1,
            2,
            width_ratios=(2, 1),
            gridspec_kw={"left": 0.1, "right": 0.97, "bottom": 0.13, "top": 0.76, "wspace": 0.42},
        )
        draw_learning_curve(curve, history, task, reference_returns, episodes)
        _draw_epsilon(epsilon, history)
        draw_episode_axis(epsilon, episodes)
        return png(figure)


def draw_phase_planes(planes: Mapping[str, PhasePlane]) -> bytes:
    """Returns a PNG with greedy efforts and values, one column for each phase plane."""
    with own_style():
        figure, grid = _figure_with_grid(2, 1, top=0.5)
        draw_planes(figure, grid[:, 0], planes)
        return png(figure)


def _figure_with_grid(rows: int, columns: int, top: float) -> tuple[Figure, GridSpec]:
    """Returns a figure with a grid of panels, which are equally high in all figures.

    Matplotlib's layout engines compute margins too, but they draw the figure twice.
    """
    from matplotlib.figure import Figure

    bottom = 0.65
    height = top + rows * ROW + (rows - 1) * BETWEEN + bottom
    figure = Figure(figsize=(_WIDTH, height))
    grid = figure.add_gridspec(
        rows,
        columns,
        left=0.95 / _WIDTH,
        right=1 - 0.25 / _WIDTH,
        bottom=bottom / height,
        top=1 - top / height,
        wspace=0.38,
        hspace=BETWEEN / ROW,
    )
    return figure, grid


def _draw_title(figure: Figure, title: str) -> None:
    """Writes the title at the upper edge, its first line larger than the second."""
    height = figure.get_size_inches()[1]
    first, _, second = title.partition("\n")
    if first:
        y = 1 - 0.1 / height
        figure.text(0.5, y, first, ha="center", va="top", fontsize=15, weight="bold")
    if second:
        y = 1 - 0.42 / height
        figure.text(0.5, y, second, ha="center", va="top", fontsize="small", color="0.3")


def _draw_epsilon(axes: Axes, history: Sequence[EpisodeRecord]) -> None:
    """Draws the share of random actions."""
    marker = "o" if len(history) == 1 else ""  # a line needs two episodes
    axes.plot([record.epsilon for record in history], marker=marker, color=CURVE, linewidth=2)
    axes.set(ylabel="Random actions (ε)", ylim=(-0.02, 1.02))
    draw_episode_axis(axes, len(history))
    axes.yaxis.set_major_formatter(lambda value, _: f"{100 * value:.0f} %")


def _draw_loss(axes: Axes, history: Sequence[EpisodeRecord]) -> None:
    losses = [record.loss for record in history]
    axes.plot(losses, ".", color="0.3", markersize=3)
    axes.set_ylabel("Loss (mean of the updates)")
    draw_episode_axis(axes, len(history))
    if any(value > 0 for value in losses):
        axes.set_yscale("log")
        _label_few_numbers(axes)


def _label_few_numbers(axes: Axes) -> None:
    """Labels whole powers of ten, or where there are none, other short numbers.

    Below 0.0001 all labels are powers: a decimal would have too many zeros.
    """
    from matplotlib.ticker import LogLocator, NullFormatter

    low, high = axes.get_ylim()
    subs = (1.0,) if high > 100 * low else (1.0, 2.0, 5.0)
    axes.yaxis.set_major_locator(LogLocator(subs=subs, numticks=6))
    if low >= _SMALLEST_DECIMAL:
        axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter(NullFormatter())


def _draw_greedy_regret(axes: Axes, evaluated: Sequence[EpisodeRecord]) -> None:
    """Draws the greedy regret of each evaluated episode, and marks the best of them."""
    episodes = [record.episode for record in evaluated]
    regrets = [record.greedy_regret for record in evaluated]
    axes.plot(episodes, regrets, ".-", color=CURVE, label="greedy policy, without exploration")
    best = min(evaluated, key=lambda record: (record.greedy_regret, -record.episode))
    name = f"best: {best.greedy_regret:.2f} after episode {best.episode}"
    axes.plot(best.episode, best.greedy_regret, "D", color="#D55E00", label=name)
    scale_greedy_regrets(axes)
    axes.set_ylim(min(0, *regrets) - 0.1, 2 * max(1, *regrets))  # no point is on the frame
    axes.set_ylabel("Greedy regret")
    axes.legend(
        loc="lower center", bbox_to_anchor=(0.5, 1), ncols=2, frameon=False, fontsize="small"
    )
