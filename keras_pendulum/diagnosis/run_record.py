"""The record of a run folder: its history, and the fit of its transitions to the pendulum."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.config.config import Config
from keras_pendulum.diagnosis.signals import Array, line_fit
from keras_pendulum.dqn.replay_buffer import Transitions
from keras_pendulum.environments.pendulum import MAX_SPEED
from keras_pendulum.history import EpisodeRecord
from keras_pendulum.optimum.dynamics import TIME_STEP
from keras_pendulum.storage.recorded_run import load_recorded_run
from keras_pendulum.storage.run_folder import RunFolder


def read_record(folder: RunFolder) -> RunRecord:
    """Returns settings, history and stored transitions of a run.

    Raises WeightsError for a damaged checkpoint, and for one that holds weights without a run.
    """
    run = load_recorded_run(folder.weights)
    return RunRecord(run.config, run.history, run.replay)


@dataclass(frozen=True)
class RunRecord:
    """The settings, the history and the stored transitions of a run."""

    config: Config
    history: list[EpisodeRecord]
    replay: Transitions  # [N, ...], oldest first

    @property
    def updates(self) -> int:
        """The number of updates."""
        return self.history[-1].updates if self.history else 0

    @property
    def steps(self) -> int:
        """The number of environment steps."""
        return self.history[-1].environment_steps if self.history else 0

    @property
    def states(self) -> Array:
        """The stored states [N, 2], θ in rad and θ̇ in rad/s."""
        cosine, sine, speed = self.replay.observation.astype(np.float64).T
        return np.stack([np.arctan2(sine, cosine), speed], axis=1)

    def seen_cells(self, cells: int = 8) -> float:
        """Returns the share of the cells of the plane, up to 4 rad/s, with a stored state."""
        theta, speed = self.states.T
        theta, speed = theta[np.abs(speed) < 4], speed[np.abs(speed) < 4]
        edges = [np.linspace(-np.pi, np.pi, cells + 1), np.linspace(-4, 4, cells + 1)]
        counts, *_ = np.histogram2d(theta, speed, bins=edges)
        return float((counts > 0).mean())

    @property
    def random_count(self) -> float:
        """The expected number of random actions among the stored transitions."""
        stored, expected = len(self.replay.action), 0.0
        before = [0, *(record.environment_steps for record in self.history)]
        for record, first in zip(self.history, before, strict=False):
            steps = record.environment_steps - max(first, self.steps - stored)
            expected += record.epsilon * max(0, steps)
        return expected

    def motion_fit(self, torques: Array) -> tuple[float, float]:
        """Returns the gravity that acted, and the correlation of the stored torque with that too.

        Gravity and torque are those with which the equation of motion best leads from each stored
        observation to the next one. The correlation is 1 in a healthy buffer.
        Both are 0 where no transition is below the speed limit.
        """
        sine, acceleration, action = self._motion
        if not len(action):
            return 0.0, 0.0
        stored = torques[action]
        causes = np.stack([1.5 * sine, 3 * stored], axis=1)
        (gravity, _), *_ = np.linalg.lstsq(causes, acceleration, rcond=None)
        acted = acceleration - gravity * causes[:, 0]
        return float(gravity), line_fit(acted, stored).correlation

    def lost_actions(self, torques: Array) -> list[int]:
        """Returns the actions that acted, but were always stored as one other action.

        The equation of motion is exact, so each transition shows which torque acted in it. No
        action is returned without 200 transitions below the speed limit, for half of the actions or
        more, and where the torques that acted are not among `torques`.
        """
        sine, acceleration, stored = self._motion
        if len(stored) < 200:
            return []
        gravity, _ = self.motion_fit(torques)
        for _ in range(3):  # a lost action changes the first fit of the gravity a little
            acted = (acceleration - 1.5 * gravity * sine) / 3
            nearest = np.abs(acted[:, None] - torques).argmin(axis=1)
            rest = acceleration - 3 * torques[nearest]
            gravity = (rest * sine).sum() / max(1.5 * (sine**2).sum(), 1e-9)
        if (np.abs(acted - torques[nearest]) < 0.01).mean() < 0.95:
            return []
        never_stored = set(nearest.tolist()) - set(self.replay.action.tolist())
        lost = sorted(
            action
            for action in never_stored
            if (nearest == action).sum() > 1 and np.ptp(stored[nearest == action]) == 0
        )
        return lost if len(lost) < len(torques) / 2 else []

    @property
    def _motion(self) -> tuple[Array, Array, NDArray[np.intp]]:
        """sin θ, acceleration and stored action of the transitions below the speed limit."""
        theta, speed = self.states.T
        next_speed = self.replay.next_observation[:, 2].astype(np.float64)
        free = np.abs(next_speed) < MAX_SPEED - 1e-3
        acceleration = (next_speed - speed) / TIME_STEP
        return np.sin(theta)[free], acceleration[free], self.replay.action[free]

    def reward_fit(self, torques: Array) -> tuple[float, float]:
        """Returns correlation and factor between the stored rewards and the exact ones.

        Both are 1 in a healthy buffer, after division by the declared scale.
        """
        rewards = self._exact_rewards(torques)
        fit = line_fit(self.replay.reward / self.config.reward_scale, rewards)
        return fit.correlation, fit.slope

    def shifted_reward_fit(self, torques: Array) -> float:
        """Returns the correlation of the stored rewards with the exact ones of the step before."""
        before = self._exact_rewards(torques)[:-1]
        same = np.all(self.replay.observation[1:] == self.replay.next_observation[:-1], axis=1)
        return line_fit(self.replay.reward[1:][same], before[same]).correlation

    def _exact_rewards(self, torques: Array) -> Array:
        theta, speed = self.states.T
        return -(theta**2) - 0.1 * speed**2 - 0.001 * torques[self.replay.action] ** 2
