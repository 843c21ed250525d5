"""The learning curve of a run, and the trailing mean that all learning curves show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from keras_pendulum.environments.task import Task
    from keras_pendulum.history import EpisodeRecord

MEAN_OVER = 10  # episodes
_LONG_MEAN_OVER = 100  # episodes, by which CartPole is usually judged
CURVE = "#0072B2"
OPTIMUM = "best possible"
RANDOM = "random actions"
# Each horizontal line has its own dashes, so that they are legible without colour.
_LEVELS = {OPTIMUM: ("black", "--", 1.5), RANDOM: ("#D55E00", ":", 2.0)}
_OTHER_LEVEL = ("#009E73", "-", 0.9)


def curve_values(history: Sequence[EpisodeRecord], task: Task) -> list[float]:
    """Returns what `task.curve_label` says, of each episode."""
    return [getattr(record, task.curve_column) for record in history]


def draw_learning_curve(
    axes: Axes,
    history: Sequence[EpisodeRecord],
    task: Task,
    reference_returns: Mapping[str, float],
    episodes: int | None = None,
) -> None:
    """Draws a dot for each episode, their mean over 10 episodes, and horizontal lines.

    The episodes before the first update are shaded. CartPole has one more line, the mean over 100
    episodes.

    Args:
        axes: to draw on.
        history: at least one record.
        task: of the run.
        reference_returns: mean returns of an episode of the same length, by name. Each becomes a
            horizontal line with its name and number in the legend.
        episodes: that the axis spans; None takes those of the history.
    """
    values = curve_values(history, task)
    without = sum(record.updates == 0 for record in history)
    if without:
        axes.axvspan(-0.5, without - 0.5, color="0.93", label="before the first update")
    axes.plot(values, ".", color="0.6", markersize=4, label="one episode")
    marker = "o" if len(values) == 1 else ""  # a line needs two episodes
    name = f"mean of {MEAN_OVER} episodes"
    axes.plot(trailing_mean(values), marker=marker, color=CURVE, linewidth=2, label=name)
    if not task.never_terminates:
        name = f"mean of {_LONG_MEAN_OVER} episodes"
        mean = trailing_mean(values, _LONG_MEAN_OVER)
        axes.plot(mean, "-.", color="#CC79A7", linewidth=2, label=name)
    steps = history[-1].environment_steps / (history[-1].episode + 1)  # of an episode
    for name, reference in reference_returns.items():
        height = task.curve_value(reference, steps)
        color, style, width = _LEVELS.get(name, _OTHER_LEVEL)
        number = f"{height:#.3g}".rstrip(".").replace("-", "−")
        label = f"{name}: {number}"
        axes.axhline(height, color=color, linestyle=style, linewidth=width, label=label)
    axes.autoscale(axis="y")  # without it, a line can coincide with the frame
    axes.set_ylabel(task.curve_label)
    draw_episode_axis(axes, episodes or len(values))
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


def trailing_mean(values: Sequence[float], over: int = MEAN_OVER) -> NDArray[np.float64]:
    """Returns the mean of each value and those before it, `over` values where there are so many."""
    import numpy as np

    sums = np.concatenate(([0.0], np.cumsum(values)))
    ends = np.arange(1, len(sums))
    starts = np.maximum(0, ends - over)
    return np.asarray((sums[ends] - sums[starts]) / (ends - starts))
