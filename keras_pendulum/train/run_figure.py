"""Figures of a run: its learning curve, greedy regret, ε, loss and phase planes."""

from __future__ import annotations

import io
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.optimum.phase_plane import EXTENT, PhasePlane
from keras_pendulum.torque_colors import SCALE
from keras_pendulum.train.learning_curve import CURVE, draw_episode_axis, draw_learning_curve

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.gridspec import GridSpec, SubplotSpec

    from keras_pendulum.history import EpisodeRecord

STYLE: Any = {"font.size": 12, "hatch.linewidth": 0.6}  # legible at half the size too
WIDTH = 9.6  # inches, as all that follow
_ROW = 2.4  # height of a panel
_BETWEEN = 0.95  # two rows: the names and numbers of an axis, and the title of the next one
_LEGEND = 0.5  # two lines, above the first row
_TITLE = 0.8
_SMALLEST_DECIMAL = 1e-4  # of the numbers at an axis


def draw_run(
    history: Sequence[EpisodeRecord],
    environment: str,
    reference_returns: Mapping[str, float],
    planes: Mapping[str, PhasePlane],
    title: str = "",
) -> bytes:
    """Returns a PNG with the learning curve of a run, its ε, its loss, and phase planes.

    The curve shows the average reward per step; for CartPole it shows the return. A run that was
    evaluated has one more curve, its greedy regret.

    Args:
        history: at least one record.
        environment: Gymnasium's name.
        reference_returns: mean returns of an episode of the same length, by name: `best possible`,
            `random actions` or others. Each becomes a horizontal line.
        planes: phase planes to draw side by side, by name; may be empty.
        title: of the figure; its first line is the larger one.
    """
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    evaluated = [record for record in history if not math.isnan(record.greedy_regret)]
    row = 2 if evaluated else 1  # of ε and loss
    rows = row + (3 if planes else 1)
    with rc_context(STYLE):
        top = _LEGEND + (_TITLE if title else 0.1)
        figure = Figure(figsize=(WIDTH, _height(rows, top)))
        draw_title(figure, title)
        grid = make_grid(figure, rows, 2, top)
        axes = figure.add_subplot(grid[0, :])
        draw_learning_curve(axes, history, environment, reference_returns)
        epsilon, loss = figure.add_subplot(grid[row, 0]), figure.add_subplot(grid[row, 1])
        draw_epsilon(epsilon, history)
        _draw_loss(loss, history)
        if evaluated:
            axes = figure.add_subplot(grid[1, :])
            _draw_greedy_regret(axes, evaluated)
            draw_episode_axis(axes, len(history))
        if planes:
            _draw_planes(figure, grid[row + 1 :, :], planes)
        return png(figure)


def draw_phase_planes(planes: Mapping[str, PhasePlane]) -> bytes:
    """Returns a PNG with greedy torques and values, one column for each phase plane."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    with rc_context(STYLE):
        figure = Figure(figsize=(WIDTH, _height(2, top=0.5)))
        _draw_planes(figure, make_grid(figure, 2, 1, top=0.5)[:, 0], planes)
        return png(figure)


def draw_title(figure: Figure, title: str) -> None:
    """Writes the title at the upper edge, its first line larger than the second."""
    height = figure.get_size_inches()[1]
    first, _, second = title.partition("\n")
    if first:
        y = 1 - 0.1 / height
        figure.text(0.5, y, first, ha="center", va="top", fontsize=15, weight="bold")
    if second:
        y = 1 - 0.42 / height
        figure.text(0.5, y, second, ha="center", va="top", fontsize="small", color="0.3")


def draw_epsilon(axes: Axes, history: Sequence[EpisodeRecord]) -> None:
    """Draws the share of random actions."""
    marker = "o" if len(history) == 1 else ""  # a line needs two episodes
    axes.plot([record.epsilon for record in history], marker=marker, color=CURVE, linewidth=2)
    axes.set(ylabel="Random actions (ε)", ylim=(-0.02, 1.02))
    draw_episode_axis(axes, len(history))
    axes.yaxis.set_major_formatter(lambda value, _: f"{100 * value:.0f} %")


def make_grid(figure: Figure, rows: int, columns: int, top: float) -> GridSpec:
    """Returns a grid of panels that are equally high in figures of any height.

    Matplotlib's layout engines compute margins too, but they draw the figure twice.
    """
    width, height = figure.get_size_inches()
    return figure.add_gridspec(
        rows,
        columns,
        left=0.95 / width,
        right=1 - 0.25 / width,
        bottom=0.65 / height,
        top=1 - top / height,
        wspace=0.38,
        hspace=_BETWEEN / _ROW,
    )


def png(figure: Figure) -> bytes:
    """Returns the figure as a PNG file."""
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=100)
    return stream.getvalue()


def _height(rows: int, top: float) -> float:
    return top + rows * _ROW + (rows - 1) * _BETWEEN + 0.65


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
    axes.set_yscale("symlog", linthresh=1)  # logarithmic from 1 on; a regret can be 0
    axes.yaxis.set_major_formatter("{x:g}")
    axes.set_ylim(min(0, *regrets) - 0.1, 2 * max(1, *regrets))  # no point is on the frame
    axes.set_ylabel("Greedy regret")
    axes.legend(
        loc="lower center", bbox_to_anchor=(0.5, 1), ncols=2, frameon=False, fontsize="small"
    )


def _draw_planes(figure: Figure, place: SubplotSpec, planes: Mapping[str, PhasePlane]) -> None:
    """Draws torques in the upper row and values in the lower one, with one scale for each row."""
    from matplotlib.colors import LinearSegmentedColormap

    rows: dict[str, tuple[str, Any]] = {
        "torque": ("Greedy torque (N·m)", LinearSegmentedColormap.from_list("torque", SCALE)),
        "value": (
            "Discounted return (max Q)",
            "viridis",
        ),  # lighter and lighter, also without colour
    }
    grid = place.subgridspec(2, len(planes), wspace=0.34, hspace=_BETWEEN / _ROW)
    for row, (attribute, (label, colors)) in enumerate(rows.items()):
        maps = {name: getattr(plane, attribute) for name, plane in planes.items()}
        all_values = np.stack(list(maps.values()))
        limits = (-2.0, 2.0) if attribute == "torque" else (all_values.min(), all_values.max())
        row_axes = []
        for column, (name, values) in enumerate(maps.items()):
            axes = figure.add_subplot(grid[row, column])
            image = axes.imshow(
                values,
                origin="lower",
                extent=EXTENT,
                aspect="auto",
                cmap=colors,
                vmin=limits[0],
                vmax=limits[1],
            )
            if attribute == "torque":
                _hatch_clockwise(axes, values)
            axes.set_yticks([-8, -4, 0, 4, 8])
            axes.set_xticks([-np.pi, 0, np.pi], ["−π", "0 (upright)", "π"])
            axes.set(title=name, xlabel="θ (rad)", ylabel="θ̇ (rad/s)")
            axes.title.set_fontsize("medium")
            row_axes.append(axes)
        bar = figure.colorbar(image, ax=row_axes, label=label, fraction=0.1, pad=0.03)
        if attribute == "torque":
            bar.set_ticks([-2, -1, 0, 1, 2])
            _hatch_clockwise(bar.ax, np.array([[-1.0, -1.0], [1.0, 1.0]]), (0, 1, -2, 2))


def _hatch_clockwise(
    axes: Axes, torques: NDArray[np.float64], extent: tuple[float, float, float, float] = EXTENT
) -> None:
    """Hatches the torques below 0, which have the darkness of those above 0."""
    if torques.min() < 0:
        hatched = axes.contourf(torques, [-3, -1e-9], extent=extent, colors="none", hatches=["//"])
        hatched.set_edgecolor("#ffffff99")
