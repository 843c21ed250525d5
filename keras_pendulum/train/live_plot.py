"""The live plot of a run, in a window or in a notebook's output."""

from __future__ import annotations

import sys
import time
from typing import TYPE_CHECKING, Any, Protocol

from keras_pendulum.display import require_display

if TYPE_CHECKING:
    from keras_pendulum.history import EpisodeRecord

_SECONDS_BETWEEN = 0.5  # between two drawings, which delay the training


class _Canvas(Protocol):
    def show(self, png: bytes) -> None:
        """Replaces the picture."""

    def closed(self) -> bool:
        """Returns whether the user has closed the window."""


class LivePlot:
    """A listener for `train_dqn` that draws the episode returns and their 100-episode mean.

    In a notebook it draws into the cell's output, else in a window. The run continues when the user
    closes the window. Create the plot before TensorFlow is imported.

    Raises UserError when there is neither a notebook nor a display.
    """

    def __init__(self) -> None:
        self._returns: list[float] = []
        self._canvas: _Canvas = _NotebookOutput() if _in_notebook() else _Window()
        self._drawn = 0.0

    def __call__(self, record: EpisodeRecord) -> None:
        """Adds an episode."""
        self._returns.append(record.episode_return)
        if not self._canvas.closed() and time.monotonic() >= self._drawn + _SECONDS_BETWEEN:
            self._draw()

    def finish(self) -> None:
        """Draws the episodes since the last drawing."""
        if self._returns and not self._canvas.closed():
            self._draw()

    def _draw(self) -> None:
        from keras_pendulum.train import run_figure

        self._canvas.show(run_figure.draw_live_curve(self._returns))
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

            if pygame.event.get(pygame.QUIT):
                self._closed = True
                pygame.display.quit()
        return self._closed


def _in_notebook() -> bool:
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython is not None else None
    return shell is not None and hasattr(shell, "kernel")
