"""What a terminal shows of a run while it goes on."""

from __future__ import annotations

import math
import shutil
import sys
import time
from collections import deque
from collections.abc import Callable
from statistics import fmean
from typing import TYPE_CHECKING

from keras_pendulum.config import Config

if TYPE_CHECKING:
    from keras_pendulum.episodes import EpisodeRecord

_EPISODES = 10  # that regret and speed are taken over
_SECONDS_BETWEEN = 0.1
_WIDTHS = (4, 20)  # of the bar, in characters, as the terminal leaves room


def make_progress(config: Config) -> Callable[[EpisodeRecord], None]:
    """A listener: a bar on a terminal; elsewhere the original's line for each episode."""
    if sys.stdout.isatty():
        return _Bar(config)
    return lambda record: print(record.line(), flush=True)


class _Bar:
    """One line: return, regret, ε, loss, steps a second, and the time that is left.

    The regret is that of the last 10 training episodes, random actions included: the best possible
    mean return of episodes as long less theirs. Where that is not known, it is left out.
    """

    def __init__(self, config: Config) -> None:
        self._config = config
        self._last: deque[EpisodeRecord] = deque(maxlen=_EPISODES + 1)
        self._best: float | None = None
        self._shown = 0.0

    def __call__(self, record: EpisodeRecord) -> None:
        """Shows one more episode."""
        if self._best is None:
            from keras_pendulum.evaluation import best_training_return

            self._best = best_training_return(self._config)
        self._last.append(record)
        done, total = record.episode + 1, self._config.episodes
        if time.monotonic() < self._shown + _SECONDS_BETWEEN and done < total:
            return
        self._shown = time.monotonic()
        columns = shutil.get_terminal_size().columns - 1
        text = f"{done}/{total}  {' '.join(self._figures(record))}"
        width = max(_WIDTHS[0], min(_WIDTHS[1], columns - len(text)))
        bar = "━" * (width * done // total)
        line = text.replace("  ", f" {bar:─<{width}} ", 1)
        # A line that is cut can be drawn over; one that wraps could not.
        print(f"\r{line[:columns]}\x1b[K", end="\n" if done == total else "", flush=True)

    def _figures(self, record: EpisodeRecord) -> list[str]:
        # How long the first of them took is known, but not how many steps it made.
        before, *last = self._last if len(self._last) > 1 else [record, record]
        assert self._best is not None
        figures = [f"return {record.episode_return:.4g}"]
        if not math.isnan(self._best):
            regret = self._best - fmean(each.episode_return for each in last)
            figures.append(f"regret {regret:.4g}")
        figures.append(f"ε {record.epsilon:.2f}")
        if not math.isnan(record.loss):
            figures.append(f"loss {record.loss:.2g}")
        seconds = sum(each.seconds for each in last)
        steps = record.environment_steps - before.environment_steps
        if steps:
            figures.append(f"{steps / seconds:.0f} steps/s")
        left = round(seconds / len(last) * (self._config.episodes - record.episode - 1))
        figures.append(f"{left // 60}:{left % 60:02} left")
        return figures
