"""A line on the terminal that says what is being done, while the user waits."""

from __future__ import annotations

import contextlib
import math
import shutil
import sys
import time
from collections.abc import Callable, Iterator

_SECONDS_BEFORE_SHARE = 3.0  # a shorter wait needs no share
_SECONDS_BEFORE_LEFT = 5.0  # before, the time left cannot be guessed
_SECONDS_BETWEEN = 0.2

Report = Callable[[float], None]  # called with the share that is done, 0 to 1


@contextlib.contextmanager
def status(text: str) -> Iterator[Report]:
    """Shows `text …` in its `with` block, on a terminal only, and erases it afterwards.

    It yields a function to call with the share that is done. After 3 s the line shows the share,
    after 5 s the time left, too.
    """
    if sys.stderr is None or not sys.stderr.isatty():
        yield lambda share: None
        return
    width = shutil.get_terminal_size().columns - 1
    began = time.monotonic()
    last_shown = began

    def show(line: str) -> None:
        print(f"\r{line[:width]:<{width}}\r", end="", file=sys.stderr, flush=True)

    def report(share: float) -> None:
        nonlocal last_shown
        now = time.monotonic()
        if now >= max(began + _SECONDS_BEFORE_SHARE, last_shown + _SECONDS_BETWEEN):
            left = ""
            if share > 0 and now >= began + _SECONDS_BEFORE_LEFT:
                minutes, seconds = divmod(math.ceil((now - began) * (1 / share - 1)), 60)
                left = f", {minutes}:{seconds:02} left"
            show(f"{text} … {share:.0%}{left}")
            last_shown = now

    show(f"{text} …")
    try:
        yield report
    finally:
        show("")
