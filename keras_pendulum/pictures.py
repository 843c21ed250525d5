"""Figures of a run and films of a policy."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.environment import TASKS
from keras_pendulum.episodes import EpisodeRecord

_MEAN_OVER = 10  # episodes
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
    from matplotlib.figure import Figure

    episodes = np.array([record.episode for record in history])
    task = TASKS[environment]
    if task.never_terminates:
        label, unit = "Average reward per step", task.steps_per_episode
        rewards = np.array([record.average_reward for record in history])
    else:  # where each step earns 1, the return is what differs
        label, unit = "Return (steps)", 1
        rewards = np.array([record.episode_return for record in history])
    figure = Figure(figsize=(8, 4.5), layout="constrained")
    axes = figure.subplots()
    axes.plot(episodes, rewards, ".", color="0.65", markersize=4, label="episode")
    if len(rewards) >= _MEAN_OVER:
        mean = np.convolve(rewards, np.ones(_MEAN_OVER) / _MEAN_OVER, "valid")
        name = f"mean of {_MEAN_OVER} episodes"
        axes.plot(episodes[_MEAN_OVER - 1 :], mean, color="#0072B2", linewidth=2, label=name)
    for (name, level), (color, style) in zip(returns.items(), _LEVEL_LINES, strict=False):
        axes.axhline(level / unit, color=color, linestyle=style, label=name)
    axes.set_xlabel("Episode")
    axes.set_ylabel(label)
    axes.legend(loc="best")
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=120)
    return stream.getvalue()


def returns(history: Sequence[float]) -> bytes:
    """The notebooks' live plot: the return of each episode, with its mean over 100.

    Args:
        history: the returns so far, at least one.

    Returns:
        A PNG file's bytes.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7, 4), layout="constrained")
    axes = figure.subplots()
    axes.plot(history, ".", color="0.65", markersize=4, label="episode")
    if len(history) >= 100:
        mean = np.convolve(history, np.ones(100) / 100, "valid")
        label = "mean of 100 episodes"
        axes.plot(range(99, len(history)), mean, color="#0072B2", linewidth=2, label=label)
    axes.set_xlabel("Episode")
    axes.set_ylabel("Return")
    axes.legend(loc="best")
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=100)
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
