"""The motion of stored transitions of the pendulum."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.diagnosis.motion import FEW, Motion, Rows
from keras_pendulum.diagnosis.signals import Array, line_fit, nearest
from keras_pendulum.dqn.replay_buffer import Transitions
from keras_pendulum.environments.pendulum import MAX_SPEED
from keras_pendulum.optimum.dynamics import TIME_STEP
from keras_pendulum.optimum.known_dynamics import KnownDynamics

_SAME_TORQUE = 0.01  # N·m, above the rounding of float32
_MOST_ACTIONS = 64  # each with a torque of its own
_SMALL = 0.02  # rad/s²


class PendulumMotion(Motion):
    """The motion of the pendulum: the equation of motion shows the torque exactly.

    It shows it wherever the speed is below its limit.
    """

    def __init__(
        self, dynamics: KnownDynamics, replay: Transitions, stored: Array, efforts: Array
    ) -> None:
        super().__init__(dynamics, replay, stored, efforts)
        theta, speed = dynamics.states_of(self.replay.observation).T
        next_speed = self.replay.next_observation[:, 2].astype(np.float64)
        free = np.abs(next_speed) < MAX_SPEED - 1e-3
        self.rows: Rows = np.flatnonzero(free)
        self.sine, self.acceleration = np.sin(theta)[free], ((next_speed - speed) / TIME_STEP)[free]

    @classmethod
    def explains(
        cls, dynamics: KnownDynamics, before: Array, action: NDArray[Any], after: Array
    ) -> bool:
        """Returns whether angle and speed fit together, and the acceleration fits the torques."""
        if cls.wrong_observations(before, after):
            return False
        (theta, speed), (next_theta, next_speed) = map(
            np.transpose, map(dynamics.states_of, (before, after))
        )
        turn = (next_theta - theta - next_speed * TIME_STEP + np.pi) % (2 * np.pi) - np.pi
        if np.mean(np.abs(turn) < 1e-3) < 0.95:
            return False
        free = np.abs(next_speed) < MAX_SPEED - 1e-3
        acceleration, used = (next_speed - speed)[free] / TIME_STEP, np.unique(action[free])
        torques = action[free][:, None] == used  # [N, A]
        if len(used) > _MOST_ACTIONS:
            torques = np.stack([action[free], np.ones(free.sum())], axis=1)
        causes = np.concatenate([np.sin(theta)[free][:, None], torques], axis=1).astype(np.float64)
        solution, *_ = np.linalg.lstsq(causes, acceleration, rcond=None)
        error = np.abs(acceleration - causes @ solution)
        return bool(len(error) and solution[0] > 0 and np.median(error) < _SMALL)

    @classmethod
    def wrong_observations(cls, before: Array, after: Array) -> str:
        """Returns what is wrong unless cos² + sin² is 1."""
        squares = (before[:, :2].astype(np.float64) ** 2).sum(axis=1)
        wrong = np.abs(squares - 1) >= 1e-3
        if wrong.mean() <= 0.05:
            return ""
        return (
            f"{wrong.mean():.0%} of the observations have a cos² + sin² that is not 1, such as "
            f"{squares[wrong][-1]:.3g}; expected [cos θ, sin θ, θ̇] of Pendulum-v1, without "
            "normalisation"
        )

    def obeying(self) -> float:
        """Returns the share that obeys the equation of motion, with the declared gravity."""
        gravity = self.dynamics.task.gravity or 0.0
        torque = self.stored[self.rows]
        error = np.abs(self.acceleration - 1.5 * gravity * self.sine - 3 * torque)
        return float(np.mean(error < 3 * _SAME_TORQUE)) if len(error) else 0.0

    def fit(self) -> tuple[float | None, float]:
        """Returns the gravity and the torque with which the equation of motion holds best."""
        if not len(self.rows):
            return 0.0, 0.0
        stored = self.stored[self.rows]
        causes = np.stack([1.5 * self.sine, 3 * stored], axis=1)
        (gravity, _), *_ = np.linalg.lstsq(causes, self.acceleration, rcond=None)
        acted = self.acceleration - gravity * causes[:, 0]
        return float(gravity), line_fit(acted, stored).correlation

    def acted_actions(self) -> tuple[Rows, Rows] | None:
        """Returns the transitions below the speed limit, and the actions that acted there.

        Tries the declared gravity and that of `fit`.
        """
        if len(self.rows) < FEW:
            return None
        for gravity in (self.dynamics.task.gravity, self.fit()[0]):
            guess = gravity or 0.0
            for _ in range(3):  # wrong stored actions change the fit of the gravity a little
                acted = (self.acceleration - 1.5 * guess * self.sine) / 3
                actions = nearest(acted, self.efforts)
                if np.mean(np.abs(acted - self.efforts[actions]) < _SAME_TORQUE) >= 0.95:
                    return self.rows, actions
                rest = self.acceleration - 3 * self.efforts[actions]
                guess = (rest * self.sine).sum() / max(1.5 * (self.sine**2).sum(), 1e-9)
        return None

    def index_efforts(self) -> Array | None:
        """Returns the torque [A] in N·m that acted where each index was stored."""
        stored, sine, acceleration = self.replay.action[self.rows], self.sine, self.acceleration
        used = np.unique(stored)
        if len(stored) < max(FEW, 20 * len(used)):
            return None
        causes = np.concatenate([1.5 * sine[:, None], 3.0 * (stored[:, None] == used)], axis=1)
        (gravity, *_), *_ = np.linalg.lstsq(causes, acceleration, rcond=None)
        place = np.searchsorted(used, stored)
        for _ in range(3):  # the median is not changed by a few wrong indices
            acted = (acceleration - 1.5 * gravity * sine) / 3
            found = np.array([np.median(acted[stored == index]) for index in used])
            near = np.abs(acted - found[place]) < 1
            rest = (acceleration - 3 * found[place])[near]
            gravity = (rest * sine[near]).sum() / max(1.5 * (sine[near] ** 2).sum(), 1e-9)
        if np.mean(np.abs(acted - found[place]) < _SAME_TORQUE) < 0.98:
            return None
        own = self.efforts.copy()
        own[used] = found
        return own
