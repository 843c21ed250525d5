"""The record of a run: its history, its steps and its stored transitions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.config.config import Config
from keras_pendulum.diagnosis.cartpole_motion import CartPoleMotion
from keras_pendulum.diagnosis.motion import Motion
from keras_pendulum.diagnosis.pendulum_motion import PendulumMotion
from keras_pendulum.diagnosis.played_steps import PlayedSteps
from keras_pendulum.diagnosis.record_sources import read_actions, steps_of, transitions_of
from keras_pendulum.diagnosis.recorded_steps import Steps
from keras_pendulum.diagnosis.signals import Array
from keras_pendulum.diagnosis.states import observation_changes
from keras_pendulum.dqn.replay_buffer import Transitions
from keras_pendulum.errors import ConfigError
from keras_pendulum.history import EpisodeRecord
from keras_pendulum.optimum.known_dynamics import KnownDynamics
from keras_pendulum.storage.recorded_run import load_recorded_run
from keras_pendulum.storage.run_folder import RunFolder

_ROWS = 5000  # whose motion shows a changed observation

Recorded = TypeVar("Recorded", Steps, Transitions)


def read_record(folder: RunFolder) -> RunRecord:
    """Returns settings, history and stored transitions of a run.

    Raises WeightsError for a damaged checkpoint, and for one that holds weights without a run.
    """
    run = load_recorded_run(folder.weights)
    return RunRecord(run.config, run.history, run.replay)


def make_record(
    record: Any, transitions: Any, efforts: Array | None, dynamics: KnownDynamics
) -> RunRecord | None:
    """Returns the record of a program of one's own, or None where it hands in neither.

    Args:
        record: a recorder, or its file.
        transitions: the content of a replay buffer, as `transitions_of` takes it.
        efforts: of the agent's outputs, [A]; None where it has none.
        dynamics: the task.

    Raises ConfigError for an action that is neither an index nor a torque, and the errors of
    `steps_of` and `transitions_of`.
    """
    if record is None and transitions is None:
        return None
    played = own = None
    if record is not None:
        steps = steps_of(record, dynamics.task)
        indices, effort = read_actions(steps.action, efforts, "record")
        acted = effort
        if acted is None:
            assert efforts is not None
            acted = efforts[indices]
        steps = _undo_change(dynamics, steps, "record")
        played, stored = PlayedSteps.of(steps, acted, efforts, dynamics), Transitions(*steps[:5])
    if transitions is not None:
        stored = _undo_change(dynamics, transitions_of(transitions, dynamics.task), "transitions")
        indices, effort = read_actions(np.asarray(stored.action), efforts, "transitions")
    if efforts is None:
        own, indices = np.unique(indices, return_inverse=True)
    replay = stored._replace(action=np.asarray(indices, np.int32))
    return RunRecord(None, [], replay, played, transitions is not None, effort, own)


def motion_kind(dynamics: KnownDynamics) -> type[Motion]:
    """Returns the class of the motion of a task."""
    return PendulumMotion if dynamics.any_effort else CartPoleMotion


def _undo_change(dynamics: KnownDynamics, recorded: Recorded, name: str) -> Recorded:
    """Returns the record with the observations [N, D] of the task.

    They stay as they are where they are right, and where no change makes them obey the dynamics.
    `name` is that of the record, for messages.

    Raises ConfigError for numbers that are not those of an observation in any order, sign or unit.
    """
    before, action, after = (
        each[-_ROWS:] for each in (recorded.observation, recorded.action, recorded.next_observation)
    )
    motion = motion_kind(dynamics)
    identity = np.eye(before.shape[1], dtype=np.float32)
    made: list[NDArray[Any]] = list(observation_changes(dynamics).values())
    for change in (identity, *made, *map(np.linalg.inv, made)):
        if motion.explains(dynamics, before @ change, action, after @ change):
            return recorded._replace(
                observation=recorded.observation @ change,
                next_observation=recorded.next_observation @ change,
            )
    if wrong := motion.wrong_observations(before, after):
        raise ConfigError(f"{name}: {wrong}")
    return recorded


@dataclass(frozen=True)
class RunRecord:
    """The known facts of a run: as much as a run folder, a recorder or a replay buffer shows."""

    config: Config | None
    history: list[EpisodeRecord]
    replay: Transitions  # [N, ...], oldest first; without a buffer, all recorded steps
    played: PlayedSteps | None = None  # of a recorder
    is_buffer: bool = True  # whether `replay` is what the network learned from
    effort: Array | None = None  # [N] N·m, where the actions were recorded as torques
    own_efforts: Array | None = None  # [A] N·m of the actions, for an agent that declares none

    @property
    def updates(self) -> int | None:
        """The number of updates; None where it is unknown."""
        return self.history[-1].updates if self.history else None

    @property
    def steps(self) -> int | None:
        """The number of environment steps; None where it is unknown."""
        if self.played is not None:
            return int(self.played.steps.total)
        if self.config is None:
            return None
        return self.history[-1].environment_steps if self.history else 0

    @property
    def random_count(self) -> float:
        """The expected number of random actions among the stored transitions."""
        stored, expected = len(self.replay.action), 0.0
        before = [0, *(record.environment_steps for record in self.history)]
        for record, first in zip(self.history, before, strict=False):
            steps = record.environment_steps - max(first, before[-1] - stored)
            expected += record.epsilon * max(0, steps)
        return expected

    def stored_efforts(self, efforts: Array) -> Array:
        """Returns the stored efforts [N]; `efforts` are those of the outputs."""
        return efforts[self.replay.action] if self.effort is None else self.effort

    @property
    def follows(self) -> NDArray[np.bool_]:
        """Which transitions [N - 1] begin where the one before ends."""
        replay = self.replay
        return np.all(replay.observation[1:] == replay.next_observation[:-1], axis=1)
