"""The texts, the colours and the edges of the drawings in the game and in films."""

from __future__ import annotations

import functools
import importlib.util
from pathlib import Path

import pygame

Color = tuple[int, int, int]

INK, PALE_INK, PAPER = (25, 25, 25), (85, 85, 85), (236, 238, 241)
WHITE, LINE = (255, 255, 255), (165, 170, 176)
ROD = (204, 77, 77)
SMALL, LARGE = 15, 21  # heights of letters in pixels

_SCALE = 4  # pygame places letters and edges at whole pixels; in a larger picture it matters less


class Writer:
    """Writes texts on a surface, with evenly spaced letters."""

    def __init__(self, screen: pygame.Surface) -> None:
        pygame.font.init()
        self.screen = screen
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
        self.screen.blit(drawn, (place[0] - round(align * drawn.get_width()), place[1]))

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
