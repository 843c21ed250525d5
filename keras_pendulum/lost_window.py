"""What becomes of a program whose window is destroyed behind its back, under the X Window System.

Xlib's own answer is to print several lines and to end the process.
"""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Callable

_ErrorHandler = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)
_EndHandler = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p)


class LossGuard:
    """Answers in Xlib's place; to be made before pygame's display is initialised.

    SDL calls, and in the end puts back, the handlers that it found when it started. Where another
    system than X has the screen it does nothing.
    """

    def __init__(self) -> None:
        self.lost = False  # whether the window has been destroyed
        # Called before the process ends because the X server does not answer any more.
        self.before_end: Callable[[], None] = lambda: None
        if os.environ.get("SDL_VIDEODRIVER") not in (None, "", "x11"):
            return
        try:
            xlib = ctypes.CDLL("libX11.so.6")  # the one that SDL loads too
        except OSError:
            return
        handlers = _ErrorHandler(self._note), _EndHandler(self._end)
        xlib.XSetErrorHandler(handlers[0])
        xlib.XSetIOErrorHandler(handlers[1])
        for handler in handlers:  # Xlib keeps only pointers to them, to the end of the process
            ctypes.pythonapi.Py_IncRef(ctypes.py_object(handler))

    def closed(self) -> bool:
        """Whether the window has been destroyed, or its owner has asked to close it."""
        import pygame

        return self.lost or bool(pygame.event.get(pygame.QUIT))

    def _note(self, display: int, event: int) -> int:
        self.lost = True
        return 0

    def _end(self, display: int) -> int:
        self.before_end()
        print("error: the connection to the display is lost", file=sys.stderr, flush=True)
        os._exit(2)  # Xlib would exit as soon as this returned
