"""The place where pictures are shown: a display or a notebook."""

from __future__ import annotations

import os
import sys

from keras_pendulum.errors import UserError


def require_display() -> None:
    """Raises UserError when no window can be opened. Without a display, SDL shows nothing."""
    if not _opens_display():
        raise UserError("there is no display to open a window on")


def _opens_display() -> bool:
    """Chooses SDL's video driver; returns whether SDL can open a window with it."""
    x, *others = map(os.environ.get, ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER"))
    if sys.platform == "linux" and not any(others):
        if not x:
            return False
        os.environ["SDL_VIDEODRIVER"] = "x11"  # else SDL tries Wayland too and prints an error
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    import pygame

    try:
        pygame.display.init()
    except pygame.error:
        return False
    return pygame.display.get_driver() != "offscreen"


def in_notebook() -> bool:
    """Returns whether the output is that of a notebook's cell."""
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython is not None else None
    return shell is not None and hasattr(shell, "kernel")
