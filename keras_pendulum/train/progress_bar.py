"""The progress of a run as one line that is drawn again and again."""

from __future__ import annotations

import math
import os
import shutil
import sys
import time
from collections import deque
from statistics import median
from typing import TYPE_CHECKING

from keras_pendulum.config.config import Config
from keras_pendulum.train.progress import MEAN_OVER, LastEpisodes, Progress, ProgressLines

if TYPE_CHECKING:
    from keras_pendulum.history import EpisodeRecord

_SECONDS_BETWEEN_DRAWINGS = 0.1
_MIN_WIDTH, _MAX_WIDTH = 4, 20  # of the bar, in characters
_LEFT_OUT_FIRST = ("steps/s", "loss", "ε", "return")  # where the terminal is narrow


def make_progress(config: Config, quiet: bool = False) -> Progress:
    """Returns a progress bar where one can be drawn, else the original's lines."""
    if quiet:
        return Progress()
    return _ProgressBar(config) if can_draw_bar() else ProgressLines(config)


def can_draw_bar() -> bool:
    """Returns whether the output is a terminal that can write over a line."""
    return sys.stdout.isatty() and os.environ.get("TERM") != "dumb"


class _ProgressBar(Progress):
    """A line with phase, return, regret, ε, loss, steps per second and remaining time.

    `regret` is the mean of the last 10 training episodes, random actions included. It is left out
    where the optimum is not known. `greedy` is the regret of the last evaluation.
    """

    def __init__(self, config: Config) -> None:
        self._config = config
        self._last = LastEpisodes(config)
        self._record: EpisodeRecord | None = None  # of the last episode
        self._phase = "training"
        self._phase_began = 0.0  # in s
        self._compiled = False  # whether the present episode waited for a compilation
        self._seconds: deque[float] = deque(maxlen=MEAN_OVER)  # of episodes with updates
        self._evaluation_seconds = 0.0  # of one evaluation
        self._greedy_regret = math.nan
        self._drawn: float | None = None  # time of the last drawing, in s
        self._marks = "━─"  # of the finished and of the remaining episodes
        try:
            self._marks.encode(sys.stdout.encoding)
        except UnicodeEncodeError:
            self._marks = "#-"

    def __call__(self, record: EpisodeRecord) -> None:
        """Draws the line after an episode."""
        self._record = record
        self._last.add(record)
        if not math.isnan(record.greedy_regret):
            self._greedy_regret = record.greedy_regret
            self._evaluation_seconds = time.monotonic() - self._phase_began
        if not (self._compiled or math.isnan(record.loss)):
            self._seconds.append(record.seconds)
        new_phase = self._phase != "training"
        self._phase, self._compiled = "training", False
        waited = self._drawn is None or time.monotonic() >= self._drawn + _SECONDS_BETWEEN_DRAWINGS
        if waited or new_phase or record.episode + 1 == self._config.episodes:
            self._draw()

    def show_phase(self, phase: str) -> None:
        """Draws the line with another phase."""
        self._phase, self._phase_began = phase, time.monotonic()
        self._compiled = self._compiled or phase == "compiling"
        self._draw()

    def end(self) -> None:
        """Ends the line, if one was drawn."""
        if self._drawn is not None:
            print(flush=True)
            self._drawn = None

    def _draw(self) -> None:
        self._drawn = time.monotonic()
        columns = shutil.get_terminal_size().columns - 1
        parts = [self._phase]
        if self._record is not None:
            done, total = self._record.episode + 1, self._config.episodes
            figures = self._figures(self._record)
            free = columns - len(f"{self._phase} {done}/{total}  ")
            for name in _LEFT_OUT_FIRST:
                if _MIN_WIDTH + len(" ".join(figures.values())) > free:
                    figures.pop(name, None)
            shown = " ".join(figures.values())
            width = max(_MIN_WIDTH, min(_MAX_WIDTH, free - len(shown)))
            finished = width * done // total
            bar = self._marks[0] * finished + self._marks[1] * (width - finished)
            parts += [f"{done}/{total}", bar, shown]
        line = " ".join(parts)
        # A line that is wider than the terminal wraps and cannot be overwritten. Spaces erase the
        # rest of the line before: an escape code would be printed by consoles that know none.
        print(f"\r{line[:columns]:<{columns}}", end="", flush=True)

    def _figures(self, record: EpisodeRecord) -> dict[str, str]:
        """Returns the texts to the right of the bar, by name."""
        figures = {"return": f"return {record.episode_return:.4g}"}
        if not math.isnan(regret := self._last.regret):
            figures["regret"] = f"regret {regret:.4g}"
        if not math.isnan(self._greedy_regret):
            figures["greedy"] = f"greedy {self._greedy_regret:.4g}"
        figures["ε"] = f"ε {record.epsilon:.2f}"
        if not math.isnan(record.loss):
            figures["loss"] = f"loss {record.loss:.2g}"
        if not math.isnan(speed := self._last.steps_per_second):
            figures["steps/s"] = f"{speed:.0f} steps/s"
        if left := self._seconds_left(record.episode + 1):
            figures["left"] = f"{left // 60}:{left % 60:02} left"
        return figures

    def _seconds_left(self, done: int) -> int:
        """Returns the estimated seconds of the remaining episodes and their evaluations.

        It is 0 when none remain, when the run was interrupted, and before the second episode with
        updates: the first one includes the compilation, and episodes without updates take far less
        time.
        """
        total, every = self._config.episodes, self._config.evaluate_every
        if done == total or not self._seconds or self._phase == "interrupted":
            return 0
        evaluations = total // every - done // every if every else 0
        seconds = median(self._seconds) * (total - done) + self._evaluation_seconds * evaluations
        return max(1, round(seconds))
