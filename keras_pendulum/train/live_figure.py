"""The picture of the live plot: the learning curve of the episodes so far, and their ε."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from keras_pendulum.train.learning_curve import draw_curve, draw_learning_curve
from keras_pendulum.train.run_figure import STYLE, WIDTH, draw_epsilon, draw_title, png

if TYPE_CHECKING:
    from keras_pendulum.history import EpisodeRecord

_HEIGHT = 5.4  # inches


def draw_live(
    history: Sequence[EpisodeRecord],
    environment: str,
    reference_returns: Mapping[str, float],
    title: str,
) -> bytes:
    """Returns a PNG with the learning curve of `rewards.png` and with ε.

    Args: those of `run_figure.draw_run`.
    """
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    with rc_context(STYLE):
        figure = Figure(figsize=(WIDTH, _HEIGHT))
        draw_title(figure, title)
        curve, epsilon = figure.subplots(
            1,
            2,
            width_ratios=(2, 1),
            gridspec_kw={"left": 0.1, "right": 0.97, "bottom": 0.13, "top": 0.76, "wspace": 0.42},
        )
        draw_learning_curve(curve, history, environment, reference_returns)
        draw_epsilon(epsilon, history)
        return png(figure)


def draw_durations(returns: Sequence[float], title: str) -> bytes:
    """Returns a PNG of the notebooks' live plot: durations and their mean over 100 episodes.

    Args:
        returns: of the episodes so far, at least one; on CartPole a return is a duration in steps.
        title: of the figure.
    """
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    with rc_context(STYLE):
        figure = Figure(figsize=(WIDTH, _HEIGHT))
        draw_title(figure, title)
        axes = figure.add_axes((0.1, 0.13, 0.87, 0.66))
        draw_curve(axes, returns, "Duration (steps)", mean_over=100, lines={})
        return png(figure)
