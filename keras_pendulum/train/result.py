"""The result of a training."""

from __future__ import annotations

from dataclasses import dataclass

from keras_pendulum.dqn.network import DQN
from keras_pendulum.evaluate.score import Score
from keras_pendulum.history import EpisodeRecord


@dataclass(frozen=True, eq=False)
class TrainingResult:
    """The trained network, and the record of each episode."""

    network: DQN  #: the network after the last update
    history: list[EpisodeRecord]  #: one record per episode, with the names of history.csv's columns
    finished: bool  #: false where `should_stop` ended the run before its last episode
    score: Score | None = None  #: of the greedy policy; None without a folder or unfinished
