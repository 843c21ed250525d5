"""Whether there is a screen to draw on."""

from __future__ import annotations

import os
import sys

from keras_pendulum.errors import UserError


def require_display() -> None:
    """Raises UserError when no window can be opened; to be called before TensorFlow is imported.

    Without a screen SDL falls back to drawing off-screen, which shows nothing and crashes beside
    TensorFlow.
    """
    variables = ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER")
    hopeless = sys.platform == "linux" and not any(map(os.environ.get, variables))
    if not hopeless:
        os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
        import pygame

        try:
            pygame.display.init()
            hopeless = pygame.display.get_driver() == "offscreen"
        except pygame.error:
            hopeless = True
    if hopeless:
        raise UserError("there is no display to open a window on")


def draw_without_display() -> None:
    """Keeps SDL from looking for a screen, which it does aloud, where only images are made."""
    os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
