"""A listener: what happens beside the training of a run."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from keras_pendulum.dqn.network import DQN
    from keras_pendulum.history import EpisodeRecord
    from keras_pendulum.train.result import TrainingResult

Phase = Literal["compiling", "evaluating", "drawing"]


class Listener:
    """Follows a run. A subclass overrides the methods that it needs."""

    def on_start(self) -> None:
        """Called before the first episode of this process."""

    def on_phase(self, phase: Phase) -> None:
        """Called when another phase than the training starts. The next record ends the phase."""

    def on_episode(self, record: EpisodeRecord) -> None:
        """Called after each episode, with its complete record."""

    def on_checkpoint(self, network: DQN, episode: int) -> None:
        """Called at each checkpoint, with the network and the last episode."""

    def on_end(self) -> None:
        """Called after the last episode, also where `should_stop` ended the run."""

    def on_result(self, result: TrainingResult) -> None:
        """Called with what `train_dqn` returns, before it draws the picture of the run."""


class FunctionListener(Listener):
    """A listener whose methods are these functions; the others do nothing."""

    def __init__(self, **functions: Callable[..., None]) -> None:
        vars(self).update(functions)
