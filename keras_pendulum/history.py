"""The record of a training episode, and its row in history.csv."""

from __future__ import annotations

import math
from typing import NamedTuple


class EpisodeRecord(NamedTuple):
    """The results of one training episode; the columns of history.csv have the same names."""

    episode: int  #: number of the episode, from 0
    average_reward: float  #: mean reward per step
    episode_return: float  #: undiscounted sum of the rewards
    epsilon: float  #: ε at the last step
    loss: float  #: mean loss of the updates of the episode; NaN without updates
    environment_steps: int  #: environment steps since the start of the run
    updates: int  #: updates since the start of the run
    seconds: float  #: wall-clock time of the episode and its updates, in seconds
    greedy_regret: float = math.nan  #: of the evaluation after the episode; NaN without one

    def line(self) -> str:
        """Returns the line that the original prints."""
        return (
            f"Episode: {self.episode}, Average Reward: {self.average_reward:.3f}, "
            f"Epsilon: {self.epsilon:.2f}"
        )

    def csv_row(self, evaluated: bool = False) -> str:
        """Returns the row of history.csv; a NaN is an empty cell, as pandas expects.

        The column `greedy_regret` is only in the files of runs that are evaluated.
        """
        values = self if evaluated else self[:-1]
        return ",".join("" if math.isnan(value) else repr(value) for value in values)


def csv_header(evaluated: bool = False) -> str:
    """Returns the header of history.csv."""
    names = EpisodeRecord._fields if evaluated else EpisodeRecord._fields[:-1]
    return ",".join(names)
