"""Which effort acted in a stored transition: the dynamics of a task, read backwards."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.diagnosis.signals import Array, line_fit, nearest
from keras_pendulum.dqn.replay_buffer import Transitions
from keras_pendulum.environments.pendulum import MAX_SPEED
from keras_pendulum.optimum.dynamics import TIME_STEP
from keras_pendulum.optimum.known_dynamics import KnownDynamics

_MOST_TRANSITIONS = 20_000  # whose motion is checked
_FEW = 200
_SAME_TORQUE = 0.01  # N·m, above the rounding of float32
_MOST_ACTIONS = 64  # each with a torque of its own
_SMALL = 0.02  # rad/s²
_SAME_STATE = 1e-3  # m, m/s, rad or rad/s

Rows = NDArray[np.intp]


class Motion(ABC):
    """The motion of stored transitions.

    Args:
        dynamics: the declared task.
        replay: the transitions [N, ...]; an action is an index of `efforts`.
        stored: the stored efforts [N].
        efforts: those of the outputs, [A].
    """

    expected: ClassVar[str]  # says what the observations are

    def __init__(
        self, dynamics: KnownDynamics, replay: Transitions, stored: Array, efforts: Array
    ) -> None:
        self.first = max(0, len(replay.action) - _MOST_TRANSITIONS)
        self.dynamics, self.efforts = dynamics, efforts
        self.replay = Transitions(*(array[self.first :] for array in replay))
        self.stored = stored[self.first :]

    @classmethod
    @abstractmethod
    def explains(
        cls, dynamics: KnownDynamics, before: Array, action: NDArray[Any], after: Array
    ) -> bool:
        """Returns whether nearly all transitions can happen, with any effort for each action.

        Args:
            dynamics: the task.
            before: observations [N, D].
            action: indices or efforts [N].
            after: the next observations.
        """

    @classmethod
    @abstractmethod
    def are_observations(cls, before: Array, after: Array) -> str:
        """Returns an empty text; for observations of another kind, what is wrong with them."""

    @abstractmethod
    def obeying(self) -> float:
        """Returns the share of transitions that obey the dynamics with the stored effort."""

    @abstractmethod
    def fit(self) -> tuple[float | None, float]:
        """Returns the gravity that acted, and the correlation of stored and acting efforts.

        The gravity is None where the task has only one. The correlation is 1 in a healthy buffer,
        and 0 where nothing is shown.
        """

    @abstractmethod
    def acted_actions(self) -> tuple[Rows, Rows] | None:
        """Returns transitions that show what acted, [M], and the actions that acted there.

        Returns None where they are less than 200, or nearly none is explained by an action.
        """

    @abstractmethod
    def index_efforts(self) -> Array | None:
        """Returns the effort [A] that acted where each index was stored.

        An index that was not stored keeps its declared effort. Returns None unless nearly each
        stored index belongs to one effort alone.
        """

    def lost_actions(self) -> list[int]:
        """Returns the actions that acted, but were always stored as one other action.

        No action is returned for half of the actions or more, and where `acted_actions` shows
        nothing.
        """
        found = self.acted_actions()
        if found is None:
            return []
        rows, acted = found
        stored = self.replay.action[rows]
        never_stored = set(acted.tolist()) - set(self.replay.action.tolist())
        lost = sorted(
            action
            for action in never_stored
            if (acted == action).sum() > 1 and np.ptp(stored[acted == action]) == 0
        )
        return lost if len(lost) < len(self.efforts) / 2 else []


class PendulumMotion(Motion):
    """The motion of the pendulum: the equation of motion shows the torque exactly.

    It shows it wherever the speed is below its limit.
    """

    expected = "[cos θ, sin θ, θ̇] of Pendulum-v1, without normalisation"

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
        if cls.are_observations(before, after):
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
    def are_observations(cls, before: Array, after: Array) -> str:
        """Returns what is wrong unless cos² + sin² is 1."""
        squares = (before[:, :2].astype(np.float64) ** 2).sum(axis=1)
        wrong = np.abs(squares - 1) >= 1e-3
        if wrong.mean() <= 0.05:
            return ""
        return (
            f"{wrong.mean():.0%} of the observations have a cos² + sin² that is not 1, such as "
            f"{squares[wrong][-1]:.3g}"
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
        if len(self.rows) < _FEW:
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
        if len(stored) < max(_FEW, 20 * len(used)):
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


class CartPoleMotion(Motion):
    """The motion of CartPole: only one of the two pushes leads to the next state."""

    expected = "[x, ẋ, θ, θ̇] of CartPole-v1, without normalisation"

    def __init__(
        self, dynamics: KnownDynamics, replay: Transitions, stored: Array, efforts: Array
    ) -> None:
        super().__init__(dynamics, replay, stored, efforts)
        self.errors = _errors(
            dynamics, self.replay.observation, self.replay.next_observation, efforts
        )

    @classmethod
    def explains(
        cls, dynamics: KnownDynamics, before: Array, action: NDArray[Any], after: Array
    ) -> bool:
        """Returns whether one of the pushes leads to nearly each next state."""
        efforts = dynamics.all_efforts(dynamics.task.actions())
        errors = _errors(dynamics, before[-1000:], after[-1000:], efforts)
        return bool(np.mean(errors.min(axis=1) < _SAME_STATE) >= 0.95)

    @classmethod
    def are_observations(cls, before: Array, after: Array) -> str:
        """Returns what is wrong where the position grows by another multiple of the speed."""
        fit = line_fit((after - before)[:, 0], before[:, 1])
        if fit.correlation < 0.99 or abs(fit.slope - 0.02) < 1e-3:
            return ""
        return f"a position that changes by {fit.slope:.3g} times the speed in a step, not by 0.02"

    def obeying(self) -> float:
        """Returns the share whose next state follows from the stored action."""
        rows = np.arange(len(self.errors))
        return float(np.mean(self.errors[rows, self.replay.action] < _SAME_STATE))

    def fit(self) -> tuple[float | None, float]:
        """Returns the correlation of the stored push with the one that acted."""
        found = self.acted_actions()
        if found is None:
            return None, 0.0
        rows, acted = found
        return None, line_fit(self.efforts[acted], self.stored[rows]).correlation

    def acted_actions(self) -> tuple[Rows, Rows] | None:
        """Returns all transitions, and the action that leads to the next state."""
        rows = np.arange(len(self.errors))
        shown = self.errors.min(axis=1) < _SAME_STATE
        if len(rows) < _FEW or shown.mean() < 0.95:
            return None
        return rows, self.errors.argmin(axis=1)

    def index_efforts(self) -> Array | None:
        """Returns the force [A] in N that acted where each index was stored."""
        found = self.acted_actions()
        if found is None:
            return None
        rows, acted = found
        reversed_share = np.mean(acted != self.replay.action[rows])
        if 0.02 < reversed_share < 0.98:
            return None
        return self.efforts[::-1].copy() if reversed_share > 0.5 else self.efforts


def _errors(
    dynamics: KnownDynamics, before: NDArray[Any], after: NDArray[Any], efforts: Array
) -> Array:
    """Returns the largest difference [N, A] of the next state to that of each effort."""
    outcomes = dynamics.outcomes(dynamics.states_of(before), efforts)
    return np.asarray(np.abs(outcomes.state - dynamics.states_of(after)[:, None]).max(axis=2))


def motion_kind(dynamics: KnownDynamics) -> type[Motion]:
    """Returns the class of the motion of a task."""
    return PendulumMotion if dynamics.any_effort else CartPoleMotion
