"""Ctrl-C while pygame draws."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def control_c() -> Iterator[Callable[[], None]]:
    """Yields a function that raises KeyboardInterrupt if Ctrl-C was pressed in the `with` block.

    Ctrl-C raises it at once, too, but the C code of pygame may drop the exception.
    """
    pressed = False

    def check() -> None:
        if pressed:
            raise KeyboardInterrupt

    def on_signal(number: int, frame: object) -> None:
        nonlocal pressed
        pressed = True
        check()

    before = signal.getsignal(signal.SIGINT)
    # A process that ignores Ctrl-C, or has its own handler, stays as it is.
    if before is signal.default_int_handler:
        signal.signal(signal.SIGINT, on_signal)
    try:
        yield check
    finally:
        signal.signal(signal.SIGINT, before)
