"""The agent under diagnosis, and the task that the user declares for it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.diagnose.states import Act

Array = NDArray[np.float64]
Observations = NDArray[np.float32]  # [B, 3]


@dataclass(frozen=True)
class Subject:
    """An agent with its declared task."""

    name: str
    gravity: float  # m/s²
    discount: float  # γ
    act: Act  # from observations [B, 3] to torques [B]
    raw_q: Callable[[Observations], Array] | None = None  # [B, A]; None for a bare policy
    torques: Array | None = None  # [A] N·m, of the outputs; None for a bare policy
    reward_scale: float = 1.0  # declared factor on the rewards
    network: Any = None  # the DQN, where its layers are known

    def q_values(self, observations: Observations) -> Array:
        """Returns the Q-values [B, A] in units of return."""
        assert self.raw_q is not None
        with np.errstate(all="ignore"):
            q = np.asarray(self.raw_q(np.asarray(observations, np.float32)), np.float64)
        return q / self.reward_scale

    def with_observations(self, change: Callable[[Observations], Observations]) -> Subject:
        """Returns the agent with its observations changed before it sees them."""
        act, raw_q = self.act, self.raw_q
        return replace(
            self,
            act=lambda observations: act(change(observations)),
            raw_q=None if raw_q is None else lambda observations: raw_q(change(observations)),
        )

    def with_torques(self, torques: Array) -> Subject:
        """Returns the agent with other torques for its outputs."""
        return replace(self, torques=torques, act=self._greedy(torques))

    def with_outputs(self, used: NDArray[np.bool_]) -> Subject:
        """Returns the agent with only the outputs that `used` [A] marks."""
        assert self.torques is not None
        return replace(self, act=self._greedy(self.torques, used))

    def _greedy(self, torques: Array, used: NDArray[np.bool_] | None = None) -> Act:
        def act(observations: Observations) -> Array:
            q = self.q_values(observations)
            if used is not None:
                q = np.where(used, q, -np.inf)
            return np.asarray(torques[q.argmax(axis=1)])

        return act
