"""A picture of a film: the environment, cropped, with the numbers of the step below."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.environments.actions import MAX_TORQUE
from keras_pendulum.torque_colors import torque_color

if TYPE_CHECKING:
    from PIL.Image import Image

WIDTH = 320  # pixels, as all that follow; even, as MP4 needs
_TITLE, _NUMBERS = 44, 84  # heights above and below the environment
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

    def after(self, reward: float, torque: float | None) -> Moment:
        """Returns the next moment."""
        return replace(self, step=self.step + 1, torque=torque, total=self.total + reward)


def draw_frame(pixels: NDArray[np.uint8], moment: Moment) -> Image:
    """Returns Gymnasium's picture [H, W, 3] with the numbers of the moment.

    The square picture is that of the pendulum; it is cropped to the circle that the rod can reach.
    """
    from PIL import Image, ImageDraw

    if pixels.shape[0] == pixels.shape[1]:
        inside = slice(_BESIDE_PENDULUM, pixels.shape[0] - _BESIDE_PENDULUM)
        pixels = pixels[inside, inside]
    height = round(WIDTH * pixels.shape[0] / pixels.shape[1] / 2) * 2
    scene = Image.fromarray(np.ascontiguousarray(pixels)).resize((WIDTH, height))
    picture = Image.new("RGB", (WIDTH, _TITLE + height + _NUMBERS), "white")
    picture.paste(scene, (0, _TITLE))
    draw = ImageDraw.Draw(picture)
    draw.text((_MARGIN, 6), moment.titles[0], _INK, _font(14, bold=True))
    draw.text((_MARGIN, 25), moment.titles[1], _PALE, _font(12))
    top = _TITLE + height
    _draw_step(draw, top, moment)
    if moment.torque is not None:
        _draw_torque(draw, top + 14, moment.torque)
    _draw_returns(draw, top + 40, moment)
    return picture


def _draw_step(draw: Any, top: int, moment: Moment) -> None:
    """Draws the step, and a line over the elapsed share of the episode."""
    draw.line((0, top, WIDTH, top), _LINE)
    draw.rectangle((0, top - 1, WIDTH * moment.step // moment.steps, top + 1), _PALE)
    place = (_MARGIN, top + 10)
    draw.text(place, f"step {moment.step} of {moment.steps}", _INK, _font(12))


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


def _draw_returns(draw: Any, top: int, moment: Moment) -> None:
    """Draws the numbers in columns that stay in their places."""
    columns = {"return": f"{moment.total:z.1f}", "best possible": f"{moment.optimum:z.1f}"}
    if moment.torque is not None:
        torque = f"{moment.torque:+.1f}" if abs(moment.torque) >= 0.05 else "0.0"
        columns = {"torque": f"{torque} N·m", **columns}
    for i, (name, number) in enumerate(columns.items()):
        right = WIDTH - _MARGIN - 104 * (len(columns) - 1 - i)
        draw.text((right, top), name, _PALE, _font(12), anchor="ra")
        draw.text(
            (right, top + 17), number.replace("-", "−"), _INK, _font(15, bold=True), anchor="ra"
        )


@cache
def _font(size: int, bold: bool = False) -> Any:
    """Returns the font that Matplotlib brings along, the same on every system."""
    from pathlib import Path

    import matplotlib
    from PIL import ImageFont

    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return ImageFont.truetype(Path(matplotlib.get_data_path(), "fonts", "ttf", name), size)
