"""The progress of a run on the terminal."""

from __future__ import annotations

import math
import os
import shutil
import sys
import time
from collections import deque
from collections.abc import Callable
from statistics import fmean
from typing import TYPE_CHECKING

from keras_pendulum.config.config import Config

if TYPE_CHECKING:
    from keras_pendulum.history import EpisodeRecord

_MEAN_OVER = 10  # episodes
_SECONDS_BETWEEN_DRAWINGS = 0.1
_MIN_WIDTH, _MAX_WIDTH = 4, 20  # of the bar, in characters


def make_progress(config: Config) -> Callable[[EpisodeRecord], None]:
    """Returns a listener: a progress bar where one can be drawn, else the original's line."""
    if can_draw_bar():
        return _ProgressBar(config)
    return lambda record: print(record.line(), flush=True)


def can_draw_bar() -> bool:
    """Returns whether the output is a terminal that can write over a line."""
    return sys.stdout.isatty() and os.environ.get("TERM") != "dumb"


class _ProgressBar:
    """A line with return, regret, ε, loss, steps per second and remaining time.

    The regret is the mean over the last 10 training episodes, random actions included. It is left
    out where the optimum is not known.
    """

    def __init__(self, config: Config) -> None:
        self._config = config
        self._recent: deque[EpisodeRecord] = deque(maxlen=_MEAN_OVER + 1)
        self._optimum: float | None = None
        self._drawn = 0.0  # time of the last drawing, in s
        self._marks = "━─"  # of the finished and of the remaining episodes
        try:
            self._marks.encode(sys.stdout.encoding)
        except UnicodeEncodeError:
            self._marks = "#-"

    def __call__(self, record: EpisodeRecord) -> None:
        """Draws the line after an episode."""
        if self._optimum is None:
            from keras_pendulum.evaluate.evaluation import optimal_training_return

            self._optimum = optimal_training_return(self._config)
        self._recent.append(record)
        done, total = record.episode + 1, self._config.episodes
        if time.monotonic() < self._drawn + _SECONDS_BETWEEN_DRAWINGS and done < total:
            return
        self._drawn = time.monotonic()
        columns = shutil.get_terminal_size().columns - 1
        count, figures = f"{done}/{total}", " ".join(self._figures(record))
        width = columns - len(count) - len(figures) - 2
        width = max(_MIN_WIDTH, min(_MAX_WIDTH, width))
        finished = width * done // total
        bar = self._marks[0] * finished + self._marks[1] * (width - finished)
        line = f"{count} {bar} {figures}"
        # A line that is wider than the terminal wraps and cannot be overwritten. Spaces erase the
        # rest of the line before: an escape code would be printed by consoles that know none.
        print(f"\r{line[:columns]:<{columns}}", end="\n" if done == total else "", flush=True)

    def _figures(self, record: EpisodeRecord) -> list[str]:
        """Returns the texts to the right of the bar."""
        # The oldest record only gives the number of steps before the others.
        oldest, *last = self._recent if len(self._recent) > 1 else [record, record]
        assert self._optimum is not None
        figures = [f"return {record.episode_return:.4g}"]
        if not math.isnan(self._optimum):
            regret = self._optimum - fmean(each.episode_return for each in last)
            figures.append(f"regret {regret:.4g}")
        figures.append(f"ε {record.epsilon:.2f}")
        if not math.isnan(record.loss):
            figures.append(f"loss {record.loss:.2g}")
        seconds = sum(each.seconds for each in last)
        steps = record.environment_steps - oldest.environment_steps
        if steps:
            figures.append(f"{steps / seconds:.0f} steps/s")
        left = round(seconds / len(last) * (self._config.episodes - record.episode - 1))
        figures.append(f"{left // 60}:{left % 60:02} left")
        return figures
