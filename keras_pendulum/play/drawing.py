"""The drawings in the window of the game that all tasks share: texts and the phase portrait."""

from __future__ import annotations

import functools
import importlib.util
import itertools
from collections.abc import Callable, Sequence
from pathlib import Path

import pygame

from keras_pendulum.play.played_task import PlayedTask

Color = tuple[int, int, int]
States = Sequence[tuple[float, float]]  # θ (rad) and θ̇ (rad/s)
Write = Callable[..., None]  # `Writer.write`

INK, PALE_INK, PAPER = (25, 25, 25), (85, 85, 85), (236, 238, 241)
WHITE, LINE = (255, 255, 255), (165, 170, 176)
ROD, _YOURS, _EARLIER = (204, 77, 77), (25, 25, 25), (150, 150, 150)
SMALL, LARGE = 15, 21  # heights of letters in pixels

_SCALE = 4  # pygame places letters and edges at whole pixels; in a larger picture it matters less


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


def draw_portrait(
    screen: pygame.Surface,
    write: Write,
    place: pygame.Rect,
    task: PlayedTask,
    path: States,
    earlier: States,
) -> None:
    """Draws the phase portrait: speed over angle, with the path of the episode.

    Args:
        screen: to draw on.
        write: of a `Writer` for the same surface.
        place: the rectangle for the portrait and its labels.
        task: has the limits of the axes.
        path: of the episode so far, dark; its last state is a dot.
        earlier: of another episode, pale.
    """
    frame = pygame.Rect(place.left + 66, place.top + 30, place.width - 90, place.height - 96)
    largest = max(task.angles), max(task.speeds)

    def pixel(state: tuple[float, float]) -> tuple[float, float]:
        x, y = (value / end for value, end in zip(state, largest, strict=True))
        x *= task.rightward  # what leans to the right is on the right
        return frame.centerx + x * frame.width / 2, frame.centery - y * frame.height / 2

    for angle, name in task.angles.items():
        x, _ = pixel((angle, 0.0))
        pygame.draw.line(screen, PAPER, (x, frame.top), (x, frame.bottom), width=2)
        write(name, (x, frame.bottom + 6), align=0.5, color=PALE_INK)
    for speed in task.speeds:
        _, y = pixel((0.0, speed))
        pygame.draw.line(screen, PAPER, (frame.left, y), (frame.right, y), width=2)
        write(f"{speed:g}", (frame.left - 8, round(y) - 8), align=1.0, color=PALE_INK)
    write("speed (rad/s) over angle", (frame.centerx, place.top + 8), align=0.5)
    for states, color, width in ((earlier, _EARLIER, 4), (path, _YOURS, 2)):
        for before, after in itertools.pairwise(states):
            # No line crosses the portrait where the angle jumps from one edge to the other.
            if abs(before[0] - after[0]) < largest[0]:
                pygame.draw.line(screen, color, pixel(before), pixel(after), width)
    pygame.draw.rect(screen, LINE, frame, width=1)
    x, y = pixel(path[-1])
    x = min(max(x, frame.left), frame.right)  # a state after a fall is outside
    y = min(max(y, frame.top), frame.bottom)
    pygame.draw.circle(screen, WHITE, (x, y), 8)
    pygame.draw.circle(screen, ROD, (x, y), 6)
    if earlier:
        write("pale: your path", (frame.left, frame.bottom + 28), color=PALE_INK)
