"""The drawings in the window of the game: texts, the pendulum, and the phase portrait."""

from __future__ import annotations

import functools
import importlib.util
import itertools
import math
from collections.abc import Callable, Sequence
from pathlib import Path

import pygame

from keras_pendulum.environments.torque import MAX_TORQUE
from keras_pendulum.figures.style import rgb, torque_color

Color = tuple[int, int, int]
States = Sequence[tuple[float, float]]  # θ (rad) and θ̇ (rad/s)
Write = Callable[..., None]  # `Writer.write`

INK, PALE_INK, PAPER = (25, 25, 25), (85, 85, 85), (236, 238, 241)
WHITE, LINE = (255, 255, 255), (165, 170, 176)
_ROD, _YOURS, _EARLIER = (204, 77, 77), (25, 25, 25), (150, 150, 150)
SMALL, LARGE = 15, 21  # heights of letters in pixels

_SCALE = 4  # pygame places letters and edges at whole pixels; in a larger picture it matters less
_MAX_SPEED = 8.0  # rad/s


class Writer:
    """Writes texts on a surface, with evenly spaced letters."""

    def __init__(self, screen: pygame.Surface) -> None:
        pygame.font.init()
        self._screen = screen
        file = _font_file()
        self._fonts = {size: pygame.font.Font(file, _SCALE * size) for size in (SMALL, LARGE)}
        self._render = functools.lru_cache(maxsize=200)(self._render_new)

    def write(
        self,
        text: str,
        place: tuple[int, int],
        size: int = SMALL,
        *,
        align: float = 0.0,
        color: Color = INK,
    ) -> None:
        """Writes text below `place`; `align` is the share of its width to the left of `place`."""
        drawn = self._render(text, size, color)
        self._screen.blit(drawn, (place[0] - round(align * drawn.get_width()), place[1]))

    def _render_new(self, text: str, size: int, color: Color) -> pygame.Surface:
        drawn = self._fonts[size].render(text, True, color)
        return pygame.transform.smoothscale_by(drawn, 1 / _SCALE)


def _font_file() -> str | None:
    """Returns the font that Matplotlib brings along, without importing Matplotlib.

    pygame's own font, which None stands for, has uneven gaps between its letters.
    """
    spec = importlib.util.find_spec("matplotlib")
    for folder in (spec.submodule_search_locations if spec else None) or ():
        file = Path(folder, "mpl-data", "fonts", "ttf", "DejaVuSans.ttf")
        if file.is_file():
            return str(file)
    return None


def draw_pendulum(angle: float, torque: float, size: tuple[int, int]) -> pygame.Surface:
    """Returns a picture of the pendulum and of its torque, an arrow around the pivot.

    Args:
        angle: θ in rad, counterclockwise from upright.
        torque: N·m, of the last step.
        size: of the picture, in pixels.
    """
    width, height = 2 * size[0], 2 * size[1]
    picture = pygame.Surface((width, height))
    picture.fill(WHITE)
    middle = pygame.Vector2(width / 2, height / 2)
    length, thick = 0.38 * height, 0.05 * height
    pygame.draw.circle(picture, PAPER, middle, length + thick, width=3)
    end = middle + length * pygame.Vector2(-math.sin(angle), -math.cos(angle))
    side = thick * pygame.Vector2(math.cos(angle), -math.sin(angle))
    pygame.draw.polygon(picture, _ROD, [middle + side, end + side, end - side, middle - side])
    for place in (middle, end):
        pygame.draw.circle(picture, _ROD, place, thick)
    pygame.draw.circle(picture, INK, middle, 0.4 * thick)
    if torque:
        _draw_arrow(picture, middle, 0.2 * height, torque)
    return pygame.transform.smoothscale(picture, size)


def _draw_arrow(
    picture: pygame.Surface, middle: pygame.Vector2, radius: float, torque: float
) -> None:
    """Draws an arc from below the pivot, as long as the torque is large.

    Its white border separates it from the rod, which is as dark.
    """
    color, direction = rgb(torque_color(torque)), math.copysign(1, torque)
    sweep = 0.75 * math.pi * abs(torque) / MAX_TORQUE
    points = []
    for i in range(121):
        around = -direction * sweep / 2 + direction * sweep * i / 120  # from below
        points.append(middle + radius * pygame.Vector2(math.sin(around), math.cos(around)))
    outward = (points[-1] - middle) / radius
    ahead = pygame.Vector2(outward.y, -outward.x) * direction
    tip, base = points[-1] + 0.32 * radius * ahead, points[-1]
    corners = [tip, base + 0.17 * radius * outward, base - 0.17 * radius * outward]
    border = 0.05 * radius
    for one, other in itertools.pairwise([*corners, corners[0]]):
        pygame.draw.line(picture, WHITE, one, other, round(2 * border))
    for shade, extra in ((WHITE, border), (color, 0.0)):
        for point in points:
            pygame.draw.circle(picture, shade, point, radius / 16 + extra)
    pygame.draw.polygon(picture, color, corners)


def draw_portrait(
    screen: pygame.Surface, write: Write, place: pygame.Rect, path: States, earlier: States
) -> None:
    """Draws the phase portrait: speed over angle, with the path of the episode.

    Args:
        screen: to draw on.
        write: of a `Writer` for the same surface.
        place: the rectangle for the portrait and its labels.
        path: of the episode so far, dark; its last state is a dot.
        earlier: of another episode, pale.
    """
    frame = pygame.Rect(place.left + 66, place.top + 30, place.width - 90, place.height - 96)
    for name, angle in (("-180°", -math.pi), ("0° (upright)", 0.0), ("180°", math.pi)):
        x, _ = _place((angle, 0.0), frame)
        pygame.draw.line(screen, PAPER, (x, frame.top), (x, frame.bottom), width=2)
        write(name, (x, frame.bottom + 6), align=0.5, color=PALE_INK)
    for speed in (-8, -4, 0, 4, 8):
        _, y = _place((0.0, speed), frame)
        pygame.draw.line(screen, PAPER, (frame.left, y), (frame.right, y), width=2)
        write(f"{speed}", (frame.left - 8, round(y) - 8), align=1.0, color=PALE_INK)
    write("speed (rad/s) over angle", (frame.centerx, place.top + 8), align=0.5)
    for states, color, width in ((earlier, _EARLIER, 4), (path, _YOURS, 2)):
        _draw_path(screen, frame, states, color, width)
    pygame.draw.rect(screen, LINE, frame, width=1)
    pygame.draw.circle(screen, WHITE, _place(path[-1], frame), 8)
    pygame.draw.circle(screen, _ROD, _place(path[-1], frame), 6)
    if earlier:
        write("pale: your path", (frame.left, frame.bottom + 28), color=PALE_INK)


def _draw_path(
    screen: pygame.Surface, frame: pygame.Rect, states: States, color: Color, width: int
) -> None:
    """Draws lines between states, except where the angle jumps from one edge to the other."""
    for before, after in itertools.pairwise(states):
        if abs(before[0] - after[0]) < math.pi:
            pygame.draw.line(screen, color, _place(before, frame), _place(after, frame), width)


def _place(state: tuple[float, float], frame: pygame.Rect) -> tuple[float, float]:
    """Returns the pixel of a state."""
    x = frame.centerx + state[0] / math.pi * frame.width / 2
    return x, frame.centery - state[1] / _MAX_SPEED * frame.height / 2
