"""The progress of a run: a bar on a terminal, else the original's lines, or nothing."""

from __future__ import annotations

import math
import os
import shutil
import sys
import time
from collections import deque
from statistics import fmean, median_low
from typing import TYPE_CHECKING

from keras_pendulum.config.config import Config
from keras_pendulum.display import in_notebook
from keras_pendulum.figures.learning_curve import MEAN_OVER
from keras_pendulum.train.listeners import Listener

if TYPE_CHECKING:
    from keras_pendulum.history import EpisodeRecord

_EPISODES_BETWEEN_MEANS = 50
_SECONDS_BETWEEN_DRAWINGS = 0.1
_MIN_WIDTH, _MAX_WIDTH = 4, 20  # of the bar, in characters
_LEFT_OUT_FIRST = ("steps/s", "loss", "ε", "return")  # where the terminal is narrow


def make_progress(config: Config, quiet: bool = False) -> Progress:
    """Returns a progress bar where one can be drawn, else the original's lines."""
    if quiet:
        return Progress(config)
    can_draw_over = (sys.stdout.isatty() and os.environ.get("TERM") != "dumb") or in_notebook()
    return _Bar(config) if can_draw_over else _Lines(config)


class Progress(Listener):
    """Shows nothing, as `--quiet` asks; its subclasses show the progress of a run."""

    def __init__(self, config: Config) -> None:
        self._config = config
        self._recent: deque[EpisodeRecord] = deque(maxlen=MEAN_OVER)

    def on_episode(self, record: EpisodeRecord) -> None:
        """Shows the record of an episode. The phase is `training` again."""
        self._recent.append(record)

    def on_phase(self, phase: str) -> None:
        """Shows what the run does now, such as `compiling`."""

    def end(self) -> None:
        """Ends the line, so that other lines can follow. No later phase is shown."""


class _Lines(Progress):
    """The original's line for each episode, and a line with the mean return after every 50."""

    def on_episode(self, record: EpisodeRecord) -> None:
        super().on_episode(record)
        lines = [record.line()]
        if (record.episode + 1) % _EPISODES_BETWEEN_MEANS == 0:
            mean = fmean(each.episode_return for each in self._recent)
            lines.append(
                f"Mean of episodes {self._recent[0].episode} to {record.episode}, random actions "
                f"included: return {mean:.2f}"
            )
        if not math.isnan(record.greedy_regret):
            regret = record.greedy_regret
            lines.append(f"Greedy policy after episode {record.episode}: regret {regret:.2f}")
        print("\n".join(lines), flush=True)


class _Bar(Progress):
    """A line with phase, return, ε, loss, steps per second and remaining time.

    `greedy` is the regret of the last evaluation. There is no regret of the training episodes: the
    returns of a few starts differ by more than what is left to learn.
    """

    def __init__(self, config: Config) -> None:
        super().__init__(config)
        self._phase = "training"
        self._phase_began = 0.0  # in s
        self._evaluation_seconds = 0.0  # of one evaluation
        self._greedy_regret = math.nan
        self._seconds: deque[float] = deque(maxlen=MEAN_OVER)  # of episodes with updates
        self._drawn: float | None = None  # time of the last drawing, in s
        self._ended = False
        self._marks = "━─"  # of the finished and of the remaining episodes
        try:
            self._marks.encode(sys.stdout.encoding)
        except UnicodeEncodeError:
            self._marks = "#-"

    def on_episode(self, record: EpisodeRecord) -> None:
        super().on_episode(record)
        if not math.isnan(record.greedy_regret):
            self._greedy_regret = record.greedy_regret
            self._evaluation_seconds = time.monotonic() - self._phase_began
        if not math.isnan(record.loss):
            self._seconds.append(record.seconds)
        new_phase, self._phase = self._phase != "training", "training"
        waited = self._drawn is None or time.monotonic() >= self._drawn + _SECONDS_BETWEEN_DRAWINGS
        if waited or new_phase or record.episode + 1 == self._config.episodes:
            self._draw()

    def on_phase(self, phase: str) -> None:
        self._phase, self._phase_began = phase, time.monotonic()
        if not self._ended:
            self._draw()

    def end(self) -> None:
        if self._drawn is not None and not self._ended:
            print(flush=True)
        self._ended = True

    def _draw(self) -> None:
        self._drawn = time.monotonic()
        columns = shutil.get_terminal_size().columns - 1
        line = self._phase
        if self._recent:
            done, total = self._recent[-1].episode + 1, self._config.episodes
            line += f" {done}/{total} "
            figures = self._figures()
            for name in _LEFT_OUT_FIRST:
                if len(line) + _MIN_WIDTH + len(" ".join(["", *figures.values()])) > columns:
                    figures.pop(name, None)
            shown = " ".join(["", *figures.values()])
            width = max(_MIN_WIDTH, min(_MAX_WIDTH, columns - len(line) - len(shown)))
            finished = width * done // total
            line += self._marks[0] * finished + self._marks[1] * (width - finished) + shown
        # A line that is wider than the terminal wraps and cannot be overwritten. Spaces erase the
        # rest of the line before: an escape code would be printed by consoles that know none.
        print(f"\r{line[:columns]:<{columns}}", end="", flush=True)

    def _figures(self) -> dict[str, str]:
        """Returns the texts to the right of the bar, by name."""
        first, last = self._recent[0], self._recent[-1]
        figures = {"return": f"return {last.episode_return:.4g}"}
        if not math.isnan(self._greedy_regret):
            figures["greedy"] = f"greedy {self._greedy_regret:.4g}"
        figures["ε"] = f"ε {last.epsilon:.2f}"
        if not math.isnan(last.loss):
            figures["loss"] = f"loss {last.loss:.2g}"
        if last is not first:
            steps = last.environment_steps - first.environment_steps
            seconds = sum(record.seconds for record in self._recent) - first.seconds
            figures["steps/s"] = f"{steps / seconds:.0f} steps/s"
        if left := self._seconds_left(last.episode + 1):
            figures["left"] = f"{left // 60}:{left % 60:02} left"
        return figures

    def _seconds_left(self, done: int) -> int:
        """Returns the estimated seconds of the remaining episodes and their evaluations.

        It is 0 when none remain, when the run was interrupted, and before the second episode with
        updates: the first one includes the compilation.
        """
        total, every = self._config.episodes, self._config.evaluate_every
        if done == total or len(self._seconds) < 2 or self._phase == "interrupted":
            return 0
        evaluations = total // every - done // every if every else 0
        # Of two episodes the faster one, because the compilation is in the other.
        seconds = median_low(self._seconds) * (total - done)
        return max(1, round(seconds + self._evaluation_seconds * evaluations))
