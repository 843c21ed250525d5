"""A run's curve, redrawn in place while it grows: in a window, or in a notebook's output."""

from __future__ import annotations

import sys
import time
from typing import TYPE_CHECKING, Any, Protocol

from keras_pendulum.display import require_display
from keras_pendulum.lost_window import LossGuard

if TYPE_CHECKING:
    from keras_pendulum.episodes import EpisodeRecord

_SECONDS_BETWEEN = 0.5  # drawing takes time from learning


class _Canvas(Protocol):
    def show(self, png: bytes) -> None:
        """Puts the picture in the place of the one before."""

    def closed(self) -> bool:
        """Whether there is no place left to draw in; asked after each episode."""


class LivePlot:
    """Draws the return of each episode with its 100-episode mean; a listener for `train_dqn`.

    In a notebook it draws into the cell's output, elsewhere in a window, which may be closed. To
    be made before TensorFlow is imported where it opens a window.

    Raises UserError when there is neither.
    """

    def __init__(self) -> None:
        self._returns: list[float] = []
        self._canvas: _Canvas = _NotebookOutput() if _in_notebook() else _Window()
        self._drawn = 0.0

    def __call__(self, record: EpisodeRecord) -> None:
        """Takes in one more episode."""
        self._returns.append(record.episode_return)
        if not self._canvas.closed() and time.monotonic() >= self._drawn + _SECONDS_BETWEEN:
            self._draw()

    def finish(self) -> None:
        """Draws what came after the last drawing."""
        if self._returns and not self._canvas.closed():
            self._draw()

    def _draw(self) -> None:
        from keras_pendulum import pictures

        self._canvas.show(pictures.live_curve(self._returns))
        self._drawn = time.monotonic()


class _NotebookOutput:
    def __init__(self) -> None:
        self._handle: Any = None

    def show(self, png: bytes) -> None:
        from IPython.display import Image, display

        if self._handle is None:
            self._handle = display(Image(png), display_id=True)
        else:
            self._handle.update(Image(png))

    def closed(self) -> bool:
        return False


class _Window:
    def __init__(self) -> None:
        self._guard = LossGuard()
        require_display()
        self._screen: Any = None
        self._closed = False

    def show(self, png: bytes) -> None:
        import io

        import pygame

        picture = pygame.image.load(io.BytesIO(png), "live.png")
        if self._screen is None:
            pygame.display.init()
            self._screen = pygame.display.set_mode(picture.get_size())
            pygame.display.set_caption("keras_pendulum")
        self._screen.blit(picture, (0, 0))
        pygame.display.flip()

    def closed(self) -> bool:
        if self._screen is not None and not self._closed:
            import pygame

            if self._guard.closed():
                self._closed = True
                pygame.display.quit()
            else:
                pygame.event.pump()
        return self._closed


def _in_notebook() -> bool:
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython is not None else None
    return shell is not None and hasattr(shell, "kernel")
