"""Figures of a run: its learning curve, greedy regret, ε, loss and phase planes."""

from __future__ import annotations

import io
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from keras_pendulum.environments.tasks import TASKS
from keras_pendulum.optimum.phase_plane import EXTENT, PhasePlane

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.gridspec import GridSpec, SubplotSpec

    from keras_pendulum.history import EpisodeRecord

_OPTIMUM = "best possible"  # drawn as a black line


def draw_run(
    history: Sequence[EpisodeRecord],
    environment: str,
    reference_returns: Mapping[str, float],
    planes: Mapping[str, PhasePlane],
) -> bytes:
    """Returns a PNG with the learning curve of a run, its ε, its loss, and phase planes.

    The curve shows the average reward per step; for CartPole it shows the return. A run that was
    evaluated has one more curve, its greedy regret.

    Args:
        history: at least one record.
        environment: Gymnasium's name.
        reference_returns: mean returns of an episode of the same length, by name: `best possible`
            and at most one more. Each becomes a horizontal line with its name in the legend.
        planes: phase planes to draw side by side, by name; may be empty.
    """
    from matplotlib.figure import Figure

    evaluated = [record for record in history if not math.isnan(record.greedy_regret)]
    row = 2 if evaluated else 1  # of ε and loss
    figure = Figure(figsize=(9, (9.5 if planes else 3) + 3 * row))
    grid = _grid(figure, row + (3 if planes else 1), 2)
    _draw_learning_curve(figure.add_subplot(grid[0, :]), history, environment, reference_returns)
    epsilon, loss = figure.add_subplot(grid[row, 0]), figure.add_subplot(grid[row, 1])
    episodes = [record.episode for record in history]
    epsilon.plot(episodes, [record.epsilon for record in history], color="#0072B2")
    epsilon.set(xlabel="Episode", ylabel="ε, share of random actions", ylim=(0, 1))
    losses = [record.loss for record in history]
    loss.plot(episodes, losses, ".", color="0.3", markersize=3)
    loss.set(xlabel="Episode", ylabel="Loss", xlim=epsilon.get_xlim())
    if any(value > 0 for value in losses):
        loss.set_yscale("log")
    if evaluated:
        axes = figure.add_subplot(grid[1, :], xlim=epsilon.get_xlim())
        _draw_greedy_regret(axes, evaluated)
    if planes:
        _draw_planes(figure, grid[row + 1 :, :], planes)
    return _png(figure)


def draw_phase_planes(planes: Mapping[str, PhasePlane]) -> bytes:
    """Returns a PNG with greedy torques and values, one column for each phase plane."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 6.5))
    _draw_planes(figure, _grid(figure, 1, 1)[0], planes)
    return _png(figure)


def draw_live_curve(returns: Sequence[float]) -> bytes:
    """Returns a PNG of the notebooks' live plot: episode returns and their mean over 100 episodes.

    Args:
        returns: returns of the episodes so far, at least one.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.6, 5.4))
    axes = figure.add_subplot(_grid(figure, 1, 1)[0])
    _draw_curve(axes, returns, "Return", mean_over=100, lines={})
    return _png(figure)


def _grid(figure: Figure, rows: int, columns: int) -> GridSpec:
    """Returns a grid with margins for the axes' labels.

    Matplotlib's layout engines compute such margins too, but they draw the figure twice.
    """
    width, height = figure.get_size_inches()
    return figure.add_gridspec(
        rows,
        columns,
        left=0.9 / width,
        right=1 - 0.2 / width,
        bottom=0.55 / height,
        top=1 - 0.4 / height,
        wspace=0.3,
        hspace=0.36,
    )


def _draw_learning_curve(
    axes: Axes,
    history: Sequence[EpisodeRecord],
    environment: str,
    reference_returns: Mapping[str, float],
) -> None:
    if TASKS[environment].never_terminates:
        values = [record.average_reward for record in history]
        steps = history[-1].environment_steps / (history[-1].episode + 1)  # per episode
        lines = {name: value / steps for name, value in reference_returns.items()}
        _draw_curve(axes, values, "Average reward per step", mean_over=10, lines=lines)
    else:  # every step has reward 1, so the curve shows the return
        values = [record.episode_return for record in history]
        _draw_curve(axes, values, "Return (steps)", mean_over=10, lines=reference_returns)


def _draw_greedy_regret(axes: Axes, evaluated: Sequence[EpisodeRecord]) -> None:
    """Draws the greedy regret of each evaluated episode, and marks the best of them."""
    episodes = [record.episode for record in evaluated]
    regrets = [record.greedy_regret for record in evaluated]
    axes.plot(episodes, regrets, ".-", color="#0072B2", label="greedy policy, without exploration")
    best = min(evaluated, key=lambda record: (record.greedy_regret, -record.episode))
    name = f"best: {best.greedy_regret:.2f} after episode {best.episode}"
    axes.plot(best.episode, best.greedy_regret, "o", color="#D55E00", label=name)
    axes.set_yscale("symlog", linthresh=1)  # logarithmic from 1 on; a regret can be 0
    axes.yaxis.set_major_formatter("{x:g}")
    axes.set_ylim(min(0, *regrets) - 0.1, 2 * max(1, *regrets))  # no point is on the frame
    axes.set(xlabel="Episode", ylabel="Greedy regret")
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1), ncols=2, frameon=False)


def _draw_curve(
    axes: Axes,
    values: Sequence[float],
    label: str,
    *,
    mean_over: int,
    lines: Mapping[str, float],
) -> None:
    """Draws one value per episode, their running mean, and horizontal lines."""
    axes.plot(values, ".", color="0.65", markersize=4, label="episode")
    if len(values) >= mean_over:
        mean = np.convolve(values, np.ones(mean_over) / mean_over, "valid")
        episodes = range(mean_over - 1, len(values))
        name = f"mean of {mean_over} episodes"
        axes.plot(episodes, mean, color="#0072B2", linewidth=2, label=name)
    for name, height in lines.items():
        color, style = ("black", "--") if name == _OPTIMUM else ("#D55E00", ":")
        axes.axhline(height, color=color, linestyle=style, label=name)
    axes.autoscale(axis="y")  # without it, a line can coincide with the frame
    axes.set(xlabel="Episode", ylabel=label)
    # The legend is above the axes, where it hides no episode.
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1), ncols=4, frameon=False)


def _draw_planes(figure: Figure, place: SubplotSpec, planes: Mapping[str, PhasePlane]) -> None:
    """Draws torques in the upper row and values in the lower one, with one scale for each row.

    The lightness of both colour maps increases monotonically, so they are legible in black and
    white.
    """
    rows = {
        "torque": ("Greedy torque (N·m)", "cividis"),
        "value": ("Value (discounted return)", "viridis"),
    }
    grid = place.subgridspec(2, len(planes), wspace=0.28, hspace=0.4)
    for row, (attribute, (label, colors)) in enumerate(rows.items()):
        maps = {name: getattr(plane, attribute) for name, plane in planes.items()}
        all_values = np.stack(list(maps.values()))
        row_axes = []
        for column, (name, values) in enumerate(maps.items()):
            axes = figure.add_subplot(grid[row, column])
            image = axes.imshow(
                values,
                origin="lower",
                extent=EXTENT,
                aspect="auto",
                cmap=colors,
                vmin=all_values.min(),
                vmax=all_values.max(),
            )
            axes.set_xticks([-np.pi, 0, np.pi], ["-π", "0 (upright)", "π"])
            axes.set(title=name, xlabel="θ (rad)", ylabel="θ̇ (rad/s)")
            row_axes.append(axes)
        figure.colorbar(image, ax=row_axes, label=label, fraction=0.1, pad=0.03)


def _png(figure: Figure) -> bytes:
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=100)
    return stream.getvalue()
