"""The progress of a run as lines, and the figures of its last episodes."""

from __future__ import annotations

import math
from collections import deque
from statistics import fmean
from typing import TYPE_CHECKING

from keras_pendulum.config.config import Config

if TYPE_CHECKING:
    from keras_pendulum.history import EpisodeRecord

MEAN_OVER = 10  # episodes
_EPISODES_BETWEEN_LINES = 50


class Progress:
    """Shows nothing, as `--quiet` asks; its subclasses show the progress of a run."""

    def __call__(self, record: EpisodeRecord) -> None:
        """Shows the record of an episode. The phase is `training` again."""

    def show_phase(self, phase: str) -> None:
        """Shows what the run does now, such as `compiling`."""

    def end(self) -> None:
        """Ends the line, so that other lines can follow."""


class LastEpisodes:
    """The means of the last 10 training episodes, random actions included."""

    def __init__(self, config: Config) -> None:
        self._config = config
        self._optimum: float | None = None
        self._records: deque[EpisodeRecord] = deque(maxlen=MEAN_OVER)
        self._steps_before: int | None = None  # steps of the run before these episodes

    def add(self, record: EpisodeRecord) -> None:
        """Adds an episode, and drops the eleventh last."""
        if record.episode == 0:
            self._steps_before = 0
        elif len(self._records) == MEAN_OVER:
            self._steps_before = self._records[0].environment_steps
        self._records.append(record)

    @property
    def first_episode(self) -> int:
        """The number of the first of these episodes."""
        return self._records[0].episode

    @property
    def mean_return(self) -> float:
        """The mean return of these episodes."""
        return fmean(record.episode_return for record in self._records)

    @property
    def regret(self) -> float:
        """The mean regret of these episodes; NaN where the optimum is not known."""
        if self._optimum is None:
            from keras_pendulum.evaluate.evaluation import optimal_training_return

            self._optimum = optimal_training_return(self._config)
        return self._optimum - self.mean_return

    @property
    def steps_per_second(self) -> float:
        """NaN for the first 10 episodes of a resumed run, whose earlier steps are not known."""
        if self._steps_before is None:
            return math.nan
        steps = self._records[-1].environment_steps - self._steps_before
        return steps / sum(record.seconds for record in self._records)


class ProgressLines(Progress):
    """The original's line for each episode, and a line with the regret after every 50 of them."""

    def __init__(self, config: Config) -> None:
        self._last = LastEpisodes(config)

    def __call__(self, record: EpisodeRecord) -> None:
        """Prints the lines of an episode."""
        lines = [record.line()]
        self._last.add(record)
        if (record.episode + 1) % _EPISODES_BETWEEN_LINES == 0:
            regret = self._last.regret
            lines.append(
                f"Mean of episodes {self._last.first_episode} to {record.episode}, random actions "
                f"included: return {self._last.mean_return:.2f}"
                + ("" if math.isnan(regret) else f", regret {regret:.2f}")
            )
        if not math.isnan(record.greedy_regret):
            regret = record.greedy_regret
            lines.append(f"Greedy policy after episode {record.episode}: regret {regret:.2f}")
        print("\n".join(lines), flush=True)
