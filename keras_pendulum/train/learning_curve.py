"""The learning curve of a run, as `rewards.png` and the live plot draw it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.environments.tasks import TASKS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from keras_pendulum.history import EpisodeRecord

MEAN_OVER = 10  # episodes
CURVE = "#0072B2"
OPTIMUM = "best possible"
RANDOM = "random actions"
# Each horizontal line has its own dashes, so that they are legible without colour.
_LEVELS = {OPTIMUM: ("black", "--", 1.5), RANDOM: ("#D55E00", ":", 2.0)}
_OTHER_LEVEL = ("#009E73", "-", 0.9)


def draw_learning_curve(
    axes: Axes,
    history: Sequence[EpisodeRecord],
    environment: str,
    reference_returns: Mapping[str, float],
) -> None:
    """Draws the average reward per step of each episode, and their mean over 10 episodes.

    For CartPole, where every step has reward 1, it draws the return.

    Args:
        axes: to draw on.
        history: at least one record.
        environment: Gymnasium's name.
        reference_returns: mean returns of an episode of the same length, by name. Each becomes a
            horizontal line with its name and number in the legend.
    """
    if TASKS[environment].never_terminates:
        values = [record.average_reward for record in history]
        steps = history[-1].environment_steps / (history[-1].episode + 1)  # per episode
        lines = {name: value / steps for name, value in reference_returns.items()}
        draw_curve(axes, values, "Reward per step", mean_over=MEAN_OVER, lines=lines)
    else:
        values = [record.episode_return for record in history]
        draw_curve(axes, values, "Return (steps)", mean_over=MEAN_OVER, lines=reference_returns)


def draw_curve(
    axes: Axes,
    values: Sequence[float],
    label: str,
    *,
    mean_over: int,
    lines: Mapping[str, float],
) -> None:
    """Draws one value per episode, their trailing mean, and horizontal lines."""
    axes.plot(values, ".", color="0.6", markersize=4, label="one episode")
    name = f"mean of {mean_over} episodes"
    marker = "o" if len(values) == 1 else ""  # a line needs two episodes
    mean = trailing_mean(values, mean_over)
    axes.plot(mean, marker=marker, color=CURVE, linewidth=2, label=name)
    for name, height in lines.items():
        color, style, width = _LEVELS.get(name, _OTHER_LEVEL)
        number = f"{height:#.3g}".rstrip(".").replace("-", "−")
        name = f"{name}: {number}"
        axes.axhline(height, color=color, linestyle=style, linewidth=width, label=name)
    axes.autoscale(axis="y")  # without it, a line can coincide with the frame
    axes.set_ylabel(label)
    draw_episode_axis(axes, len(values))
    # The legend is above the axes, where it hides no episode.
    axes.legend(
        loc="lower left",
        bbox_to_anchor=(0, 1),
        ncols=3,
        frameon=False,
        fontsize="small",
        borderaxespad=0.2,
    )


def draw_episode_axis(axes: Axes, episodes: int) -> None:
    """Draws an axis of whole numbers that ends shortly after the last episode."""
    from matplotlib.ticker import MaxNLocator

    margin = max(0.5, 0.04 * episodes)
    axes.set(xlabel="Episode", xlim=(-margin, episodes - 1 + margin))
    axes.xaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10], integer=True, min_n_ticks=1))


def trailing_mean(values: Sequence[float], over: int) -> NDArray[np.float64]:
    """Returns the mean of each value and those before it, `over` values where there are so many."""
    sums = np.concatenate(([0.0], np.cumsum(values)))
    ends = np.arange(1, len(sums))
    starts = np.maximum(0, ends - over)
    return (sums[ends] - sums[starts]) / (ends - starts)
