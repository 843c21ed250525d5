"""The motion of stored transitions of CartPole."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.diagnosis.motion import FEW, Motion, Rows
from keras_pendulum.diagnosis.signals import Array, line_fit
from keras_pendulum.optimum.known_dynamics import KnownDynamics

_SAME_STATE = 1e-3  # m, m/s, rad or rad/s


class CartPoleMotion(Motion):
    """The motion of CartPole: only one of the two pushes leads to the next state."""

    @cached_property
    def errors(self) -> Array:
        """The largest difference [N, A] of the next state to that of each effort."""
        replay = self.replay
        return _errors(self.dynamics, replay.observation, replay.next_observation, self.efforts)

    @classmethod
    def explains(
        cls, dynamics: KnownDynamics, before: Array, action: NDArray[Any], after: Array
    ) -> bool:
        """Returns whether one of the pushes leads to nearly each next state."""
        efforts = dynamics.efforts(dynamics.task.actions().values)
        errors = _errors(dynamics, before[-1000:], after[-1000:], efforts)
        return bool(np.mean(errors.min(axis=1) < _SAME_STATE) >= 0.95)

    @classmethod
    def wrong_observations(cls, before: Array, after: Array) -> str:
        """Returns what is wrong where the position grows by another multiple of the speed."""
        fit = line_fit((after - before)[:, 0], before[:, 1])
        steps = fit.slope / 0.02  # of one transition: a wrapper may repeat each action
        repeats = steps > 1.5 and abs(steps - round(steps)) < 0.1
        if fit.correlation < 0.99 or abs(fit.slope - 0.02) < 1e-3 or repeats:
            return ""
        return (
            f"a position that changes by {fit.slope:.3g} times the speed in a step, not by 0.02; "
            "expected [x, ẋ, θ, θ̇] of CartPole-v1, without normalisation"
        )

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
        if len(rows) < FEW or shown.mean() < 0.95:
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
