"""The live plot of a run, in a window or in a notebook's output."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

from keras_pendulum.display import in_notebook, require_display
from keras_pendulum.train.listeners import Listener

if TYPE_CHECKING:
    from keras_pendulum.config.config import Config
    from keras_pendulum.history import EpisodeRecord

_SECONDS_BETWEEN = 0.5  # between two drawings, which delay the training


class LivePlot(Listener):
    """A listener that draws the learning curve of `rewards.png`, and ε.

    In a notebook it draws into the cell's output, else in a window. The run continues when the user
    closes the window.

    Raises UserError when there is neither a notebook nor a display.
    """

    def __init__(self, config: Config) -> None:
        self._config = config
        self._history: list[EpisodeRecord] = []
        self._levels: dict[str, float] | None = None  # known from the first drawing on
        self._canvas = _NotebookOutput() if in_notebook() else _Window()
        self._drawn = 0.0

    def on_episode(self, record: EpisodeRecord) -> None:
        """Adds an episode."""
        self._history.append(record)
        if not self._canvas.closed() and time.monotonic() >= self._drawn + _SECONDS_BETWEEN:
            self._draw()

    def on_end(self) -> None:
        """Draws the episodes since the last drawing."""
        if self._history and not self._canvas.closed():
            self._draw()

    def wait_until_closed(self) -> None:
        """Returns when the user has closed the window; at once where there is none."""
        while self.is_open:
            time.sleep(0.05)

    @property
    def is_open(self) -> bool:
        """Whether there is a window that the user can close."""
        return self._canvas.is_window and not self._canvas.closed()

    def _draw(self) -> None:
        self._canvas.show(self._picture())
        self._drawn = time.monotonic()

    def _picture(self) -> bytes:
        from keras_pendulum.figures.run_figure import draw_live
        from keras_pendulum.train.reference_returns import reference_returns, run_title

        if self._levels is None:
            self._levels = reference_returns(self._config)
        title = run_title(self._config)
        return draw_live(
            self._history, self._config.task, self._levels, title, self._config.episodes
        )


class _NotebookOutput:
    def __init__(self) -> None:
        self._handle: Any = None

    is_window = False  # the output of a cell stays

    def show(self, png: bytes) -> None:
        """Replaces the picture."""
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

    @property
    def is_window(self) -> bool:
        return self._screen is not None

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
