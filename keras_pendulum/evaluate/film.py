"""The film of an episode: a picture of each step, with its numbers."""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.environments.task import Task
from keras_pendulum.environments.torque import MAX_TORQUE
from keras_pendulum.evaluate.policy import Policy
from keras_pendulum.figures.style import torque_color
from keras_pendulum.optimum.solutions import solution

if TYPE_CHECKING:
    from PIL.Image import Image

_log = logging.getLogger(__name__)

_WIDTH = 320  # pixels, as all that follow; even, as MP4 needs
_ABOVE, _BELOW = 44, 84  # heights of the texts above and below the environment
_MARGIN = 12
_BESIDE_PENDULUM = 112  # of Gymnasium's picture of the pendulum, which is empty there
_INK, _PALE, _LINE = "#191919", "#5a5a5a", "#afb4ba"


@dataclass(frozen=True)
class Moment:
    """The numbers of a step."""

    titles: tuple[str, str]
    step: int
    steps: int  # of a whole episode
    torque: float | None  # N·m, of the last step; None for CartPole
    total: float  # the return so far
    optimum: float  # the optimal return of a whole episode


def film_episode(
    policy: Policy, task: Task, titles: tuple[str, str], seed: int, angle: float | None
) -> Iterator[Image]:
    """Yields a picture of the start and of each step of an episode, under two lines of title.

    The start is that of the seed, or with an angle in degrees, at rest, counterclockwise from
    upright. The optimum of such a start is computed, which takes some 20 s. Raises ConfigError for
    an angle where the start cannot be chosen.
    """
    with contextlib.closing(task.make_env("rgb_array")) as env:
        observation, _ = env.reset(seed=seed)
        if angle is None:
            optimum = float(solution(task).best_returns([seed])[0])
        else:
            observation = task.reset_to_angle(env, angle)
            _log.warning("Computing the best possible return of the film's start: about 20 s")
            optimum = solution(task).best_return_at(angle)
        policy.reset()
        torque = task.torque_of(np.zeros(1))
        step, total, done = 0, 0.0, False
        while True:
            moment = Moment(titles, step, task.steps_per_episode, torque, total, optimum)
            yield draw_frame(np.asarray(env.render()), moment)
            if done:
                return
            action = policy.action(observation)
            observation, reward, terminated, truncated, _ = env.step(action)
            done = terminated or truncated
            step, total = step + 1, total + float(reward)
            torque = task.torque_of(action)


def draw_frame(pixels: NDArray[np.uint8], moment: Moment) -> Image:
    """Returns Gymnasium's picture [H, W, 3] with the numbers of the moment.

    The square picture is that of the pendulum; it is cropped to the circle that the rod can reach.
    """
    from PIL import Image, ImageDraw

    if pixels.shape[0] == pixels.shape[1]:
        inside = slice(_BESIDE_PENDULUM, pixels.shape[0] - _BESIDE_PENDULUM)
        pixels = pixels[inside, inside]
    height = round(_WIDTH * pixels.shape[0] / pixels.shape[1] / 2) * 2
    scene = Image.fromarray(np.ascontiguousarray(pixels)).resize((_WIDTH, height))
    picture = Image.new("RGB", (_WIDTH, _ABOVE + height + _BELOW), "white")
    picture.paste(scene, (0, _ABOVE))
    draw = ImageDraw.Draw(picture)
    draw.text((_MARGIN, 6), moment.titles[0], _INK, _font(14, bold=True))
    draw.text((_MARGIN, 25), moment.titles[1], _PALE, _font(12))
    top = _ABOVE + height
    # A line over the elapsed share of the episode.
    draw.line((0, top, _WIDTH, top), _LINE)
    draw.rectangle((0, top - 1, _WIDTH * moment.step // moment.steps, top + 1), _PALE)
    draw.text((_MARGIN, top + 10), f"step {moment.step} of {moment.steps}", _INK, _font(12))
    if moment.torque is not None:
        _draw_torque(draw, top + 14, moment.torque)
    _draw_numbers(draw, top + 40, moment)
    return picture


def _draw_torque(draw: Any, top: int, torque: float) -> None:
    """Draws the torque as a bar, to the right for counterclockwise, between arrows that say so."""
    middle, half = 236, 56
    for side, arrow in ((-1, "↻"), (1, "↺")):
        draw.text((middle + side * (half + 9), top + 4), arrow, _INK, _font(15), anchor="mm")
    length = round(half * min(1.0, abs(torque) / MAX_TORQUE))
    left, right = (middle - length, middle) if torque < 0 else (middle, middle + length)
    draw.rectangle((left, top, right, top + 8), torque_color(torque))
    draw.rectangle((middle - half, top, middle + half, top + 8), outline=_LINE)
    draw.line((middle, top - 2, middle, top + 10), _INK)


def _draw_numbers(draw: Any, top: int, moment: Moment) -> None:
    """Draws torque and returns in columns that stay in their places."""
    columns = {"return": f"{moment.total:z.1f}", "best possible": f"{moment.optimum:z.1f}"}
    if moment.torque is not None:
        torque = f"{moment.torque:+.1f}" if abs(moment.torque) >= 0.05 else "0.0"
        columns = {"torque": f"{torque} N·m", **columns}
    for i, (name, number) in enumerate(columns.items()):
        right = _WIDTH - _MARGIN - 104 * (len(columns) - 1 - i)
        draw.text((right, top), name, _PALE, _font(12), anchor="ra")
        number = number.replace("-", "−")
        draw.text((right, top + 17), number, _INK, _font(15, bold=True), anchor="ra")


@cache
def _font(size: int, bold: bool = False) -> Any:
    """Returns the font that Matplotlib brings along, the same on every system."""
    import matplotlib
    from PIL import ImageFont

    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return ImageFont.truetype(Path(matplotlib.get_data_path(), "fonts", "ttf", name), size)
