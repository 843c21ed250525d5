"""Figures of a run and films of a policy."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.environment import TASKS
from keras_pendulum.phase_plane import EXTENT, PhasePlane

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.gridspec import GridSpec, SubplotSpec

    from keras_pendulum.episodes import EpisodeRecord

_BEST = "best possible"  # the level that is drawn in black


def finished_run(
    history: Sequence[EpisodeRecord],
    environment: str,
    returns: Mapping[str, float],
    planes: Mapping[str, PhasePlane],
) -> bytes:
    """A run at a look: the originals' learning curve, ε, loss, and maps of the phase plane.

    The curve is the average reward a step, or CartPole's return, over the episodes.

    Args:
        history: at least one record.
        environment: which the episodes are of.
        returns: mean returns of episodes as long as these to compare with, by name:
            `best possible`, and one more at most; each a level line.
        planes: maps to set side by side, by name; may be empty.

    Returns:
        A PNG file's bytes.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 12.5 if planes else 6))
    grid = _grid(figure, 4 if planes else 2, 2)
    _draw_learning_curve(figure.add_subplot(grid[0, :]), history, environment, returns)
    epsilon, loss = figure.add_subplot(grid[1, 0]), figure.add_subplot(grid[1, 1])
    episodes = [record.episode for record in history]
    epsilon.plot(episodes, [record.epsilon for record in history], color="#0072B2")
    epsilon.set(xlabel="Episode", ylabel="ε, share of random actions", ylim=(0, 1))
    losses = [record.loss for record in history]
    loss.plot(episodes, losses, ".", color="0.3", markersize=3)
    loss.set(xlabel="Episode", ylabel="Loss", xlim=epsilon.get_xlim())
    if any(value > 0 for value in losses):
        loss.set_yscale("log")
    if planes:
        _draw_planes(figure, grid[2:, :], planes)
    return _png(figure)


def phase_planes(planes: Mapping[str, PhasePlane]) -> bytes:
    """Greedy torque and value over the phase plane, one column for each policy: a PNG."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 6.5))
    _draw_planes(figure, _grid(figure, 1, 1)[0], planes)
    return _png(figure)


def live_curve(returns: Sequence[float]) -> bytes:
    """The notebooks' live plot: the return of each episode, with its mean over 100.

    Args:
        returns: of the episodes so far, at least one.

    Returns:
        A PNG file's bytes.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.6, 5.4))
    axes = figure.add_subplot(_grid(figure, 1, 1)[0])
    _draw_curve(axes, returns, "Return", mean_over=100, levels={})
    return _png(figure)


def _grid(figure: Figure, rows: int, columns: int) -> GridSpec:
    """Places for axes with their labels.

    Matplotlib's own layout engines find them too, but draw a figure twice for it.
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
    returns: Mapping[str, float],
) -> None:
    if TASKS[environment].never_terminates:
        values = [record.average_reward for record in history]
        steps = history[-1].environment_steps / (history[-1].episode + 1)  # the same in each
        levels = {name: level / steps for name, level in returns.items()}
        _draw_curve(axes, values, "Average reward per step", mean_over=10, levels=levels)
    else:  # where each step earns 1, the return is what differs
        values = [record.episode_return for record in history]
        _draw_curve(axes, values, "Return (steps)", mean_over=10, levels=returns)


def _draw_curve(
    axes: Axes,
    values: Sequence[float],
    label: str,
    *,
    mean_over: int,
    levels: Mapping[str, float],
) -> None:
    """A value for each episode from 0 on, with its running mean and level lines."""
    axes.plot(values, ".", color="0.65", markersize=4, label="episode")
    if len(values) >= mean_over:
        mean = np.convolve(values, np.ones(mean_over) / mean_over, "valid")
        name = f"mean of {mean_over} episodes"
        axes.plot(range(mean_over - 1, len(values)), mean, color="#0072B2", linewidth=2, label=name)
    for name, level in levels.items():
        color, style = ("black", "--") if name == _BEST else ("#D55E00", ":")
        axes.axhline(level, color=color, linestyle=style, label=name)
    axes.autoscale(axis="y")  # else a level between the outermost episode and the frame lies on it
    axes.set(xlabel="Episode", ylabel=label)
    # Above, where it covers no episode.
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1), ncols=4, frameon=False)


def _draw_planes(figure: Figure, place: SubplotSpec, planes: Mapping[str, PhasePlane]) -> None:
    """Torques in the upper row and values in the lower one, each row on one scale.

    Both colour maps grow lighter all the way, so that they can be read in black and white.
    """
    rows = {
        "torque": ("Greedy torque (N·m)", "cividis"),
        "value": ("Value (discounted reward to come)", "viridis"),
    }
    grid = place.subgridspec(2, len(planes), wspace=0.28, hspace=0.4)
    for row, (part, (label, colors)) in enumerate(rows.items()):
        maps = {name: getattr(plane, part) for name, plane in planes.items()}
        shown = np.stack(list(maps.values()))
        drawn = []
        for column, (name, values) in enumerate(maps.items()):
            axes = figure.add_subplot(grid[row, column])
            image = axes.imshow(
                values,
                origin="lower",
                extent=EXTENT,
                aspect="auto",
                cmap=colors,
                vmin=shown.min(),
                vmax=shown.max(),
            )
            axes.set_xticks([-np.pi, 0, np.pi], ["-π", "0 (upright)", "π"])
            axes.set(title=name, xlabel="θ (rad)", ylabel="θ̇ (rad/s)")
            drawn.append(axes)
        figure.colorbar(image, ax=drawn, label=label, fraction=0.1, pad=0.03)


def _png(figure: Figure) -> bytes:
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=100)
    return stream.getvalue()


def gif(frames: Sequence[NDArray[np.uint8]], seconds_per_frame: float, height: int = 250) -> bytes:
    """An endless GIF of RGB frames [H, W, 3], scaled to `height` pixels."""
    from PIL import Image

    size = (round(frames[0].shape[1] / frames[0].shape[0] * height), height)
    images: list[Any] = [Image.fromarray(frame).resize(size) for frame in frames]
    stream = io.BytesIO()
    images[0].save(
        stream,
        format="GIF",
        save_all=True,
        append_images=images[1:],
        duration=round(1000 * seconds_per_frame),
        loop=0,
    )
    return stream.getvalue()
