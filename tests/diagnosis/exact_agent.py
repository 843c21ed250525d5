"""Measurements of agents whose Q-values are the exact ones, without a computed table."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.diagnosis.diagnose import diagnose_measurement
from keras_pendulum.diagnosis.diagnosis import Diagnosis
from keras_pendulum.diagnosis.measurement import Measurement
from keras_pendulum.diagnosis.run_record import RunRecord
from keras_pendulum.environments.actions import TorqueGrid
from keras_pendulum.environments.pendulum import Pendulum
from keras_pendulum.evaluate.policy import Policy
from keras_pendulum.optimum.discounted import solve_discounted
from keras_pendulum.optimum.dynamics import TORQUES
from keras_pendulum.optimum.pendulum import PendulumSolution

NOISE = np.random.RandomState(0).normal(size=(3, 41))


@cache
def coarse_value(gravity: float, discount: float) -> NDArray[np.float32]:
    """Returns V on few cells, so that no test waits for the computation."""
    return solve_discounted(gravity, discount, cells=40)


def exact_values(
    observations: NDArray[np.float32], gravity: float = 1.0, discount: float = 0.9
) -> NDArray[np.float64]:
    """Returns the exact Q-values [B, 41] of observations [B, 3]."""
    theta = np.arctan2(observations[:, 1], observations[:, 0]).astype(np.float64)
    speed = np.clip(observations[:, 2].astype(np.float64), -8, 8)
    table = coarse_value(gravity, discount or 0.9)  # of no effect for 0
    states = np.stack([theta, speed], axis=1)
    return PendulumSolution(Pendulum(gravity)).exact_q(table, discount, states, TORQUES)


def untrained_outputs(observations: Any) -> Any:
    """Returns small Q-values [B, 41], of which two outputs are above all others."""
    q = 0.14 * exact_values(observations) - 1
    q[:, [2, 4]] = 0.3
    return q


class ExactPolicy(Policy):
    """The greedy policy of a function from observations [B, 3] to Q-values [B, 41].

    `share` is a factor on its torques. With `bare`, it has no Q-values to look at.
    """

    def __init__(self, q_values: Any, share: float = 1.0, bare: bool = False) -> None:
        super().__init__("agent", actions=None if bare else TorqueGrid())
        self.has_q_values = not bare
        self._q_values, self._share = q_values, share

    def q_values(self, observations: Any) -> Any:
        return self._q_values(observations)

    def act(self, observations: Any) -> Any:
        indices = self._q_values(observations).argmax(axis=1)
        return self._share * TORQUES[indices][:, np.newaxis]


PENDULUM = PendulumSolution(Pendulum())


def measure(
    q_values: Any,
    record: RunRecord | None = None,
    gravity: float = 1.0,
    discount: float = 0.9,
    **options: Any,
) -> Measurement:
    policy = ExactPolicy(q_values, **options)
    measured = Measurement(policy, Pendulum(gravity), discount, record=record)
    vars(measured)["table"] = coarse_value(gravity, discount)
    return measured


def diagnose_values(q_values: Any, record: RunRecord | None = None, **options: Any) -> Diagnosis:
    return diagnose_measurement(measure(q_values, record, **options))
