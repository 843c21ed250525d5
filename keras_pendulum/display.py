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
    x, *others = map(os.environ.get, ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER"))
    linux = sys.platform == "linux"
    hopeless = linux and not x and not any(others)
    if not hopeless:
        if linux and not any(others):
            os.environ["SDL_VIDEODRIVER"] = "x11"  # else it tries Wayland too, which complains
        os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
        import pygame

        try:
            pygame.display.init()
            driver = pygame.display.get_driver()
            hopeless = driver == "offscreen"
            if driver == "x11":
                # SDL would put its pictures up by way of OpenGL, whose drivers may bring an LLVM
                # that crashes beside TensorFlow's. Other systems have no other way.
                os.environ.setdefault("SDL_FRAMEBUFFER_ACCELERATION", "0")
        except pygame.error:
            hopeless = True
    if hopeless:
        raise UserError("there is no display to open a window on")


def draw_without_display() -> None:
    """Keeps SDL from looking for a screen, which it does aloud, where only images are made."""
    os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
