"""Figures of a run and films of a policy."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.environment import TASKS
from keras_pendulum.episodes import EpisodeRecord

_LEVEL_LINES = (("black", "--"), ("#D55E00", ":"))


def learning_curve(
    history: Sequence[EpisodeRecord], environment: str, returns: Mapping[str, float]
) -> bytes:
    """The originals' plots: episode against average reward a step, or against CartPole's return.

    Args:
        history: at least one record.
        environment: which the episodes are of.
        returns: mean returns of whole episodes to compare with, by name; each a level line.

    Returns:
        A PNG file's bytes.
    """
    task = TASKS[environment]
    if task.never_terminates:
        rewards = [record.average_reward for record in history]
        levels = {name: level / task.steps_per_episode for name, level in returns.items()}
        return _curve(rewards, "Average reward per step", mean_over=10, levels=levels)
    # Where each step earns 1, the return is what differs.
    steps = [record.episode_return for record in history]
    return _curve(steps, "Return (steps)", mean_over=10, levels=returns)


def live_curve(returns: Sequence[float]) -> bytes:
    """The notebooks' live plot: the return of each episode, with its mean over 100.

    Args:
        returns: of the episodes so far, at least one.

    Returns:
        A PNG file's bytes.
    """
    return _curve(returns, "Return", mean_over=100, levels={})


def _curve(
    values: Sequence[float], label: str, *, mean_over: int, levels: Mapping[str, float]
) -> bytes:
    """A value for each episode from 0 on, with its running mean and level lines: a PNG."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 4.5), layout="constrained")
    axes = figure.subplots()
    axes.plot(values, ".", color="0.65", markersize=4, label="episode")
    if len(values) >= mean_over:
        mean = np.convolve(values, np.ones(mean_over) / mean_over, "valid")
        name = f"mean of {mean_over} episodes"
        axes.plot(range(mean_over - 1, len(values)), mean, color="#0072B2", linewidth=2, label=name)
    for (name, level), (color, style) in zip(levels.items(), _LEVEL_LINES, strict=False):
        axes.axhline(level, color=color, linestyle=style, label=name)
    axes.set_xlabel("Episode")
    axes.set_ylabel(label)
    figure.legend(loc="outside upper center", ncols=4)  # where it covers no episode
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=120)
    return stream.getvalue()


def gif(frames: Sequence[NDArray[np.uint8]], seconds_per_frame: float, size: int = 250) -> bytes:
    """An endless GIF of RGB frames [H, W, 3], scaled to `size` pixels a side."""
    from PIL import Image

    images: list[Any] = [Image.fromarray(frame).resize((size, size)) for frame in frames]
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
