"""Both sides of an equation for the values of a network, and how well they agree."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.diagnosis.signals import Array, advantages, line_fit
from keras_pendulum.diagnosis.states import OBSERVATION_CHANGES, observe
from keras_pendulum.optimum.dynamics import step_all_torques


class Backup(NamedTuple):
    """The values of a network at N states and at all states that can follow them."""

    q: Array  # [N, A]
    reward: Array  # [N, A]
    next_q: Array  # [N, A, A]: the last axis is the torque of the next step
    discount: float  # γ
    next_observation: NDArray[np.float32]  # [N · A, 3]

    @property
    def right(self) -> Array:
        """The right targets [N, A]."""
        return self.reward + self.discount * self.next_q.max(axis=2)

    @property
    def offset(self) -> Array:
        """The values minus the rewards of one step, [N, A]."""
        return self.q - self.reward

    @property
    def offset_is_smooth(self) -> bool:
        """Whether `offset` is nearly linear in the next observation and its absolute speed.

        So is the value of a network that has never learned.
        """
        observed = self.next_observation.astype(float)
        causes = np.column_stack([np.ones(len(observed)), observed, np.abs(observed[:, 2])])
        offset = self.offset.ravel()
        solution, *_ = np.linalg.lstsq(causes, offset, rcond=None)
        return bool((offset - causes @ solution).var() < 0.4 * offset.var())

    @property
    def reward_factor(self) -> float:
        """The factor on the rewards with which the values obey the right equation best."""
        rest = self.q - self.discount * self.next_q.max(axis=2)
        return float((rest * self.reward).sum() / max((self.reward**2).sum(), 1e-12))


@dataclass(frozen=True)
class Visited:
    """A network at the states that it visits, and its declared task."""

    q_values: Callable[[NDArray[np.float32]], Array]  # from observations [B, 3] to [B, A]
    states: Array  # [N, 2], θ in rad and θ̇ in rad/s
    torques: Array  # N·m of the outputs, [A]
    gravity: float  # m/s²
    discount: float  # γ

    def backup(
        self,
        gravity: float | None = None,
        torques: Array | None = None,
        observation: str | None = None,
    ) -> Backup:
        """Returns the values at the states and at all that can follow.

        Args:
            gravity: m/s², in place of the declared one.
            torques: N·m of the outputs [A], in place of the declared ones.
            observation: one of `OBSERVATION_CHANGES`, made before the network sees the observation.
        """
        change, states = np.eye(3, dtype=np.float32), self.states
        if observation is not None:  # there are many, so a quarter of the states is enough
            change, states = OBSERVATION_CHANGES[observation], self.states[::4]
        reward, theta, speed = step_all_torques(
            self.gravity if gravity is None else gravity,
            states[:, 0],
            states[:, 1],
            self.torques if torques is None else torques,
        )
        following = np.stack([theta.ravel(), speed.ravel()], axis=1)
        next_observation: NDArray[np.float32] = observe(following) @ change
        next_q = self.q_values(next_observation).reshape(*reward.shape, -1)
        q = self.q_values(observe(states) @ change)
        return Backup(q, reward, next_q, self.discount, next_observation)


class Agreement(NamedTuple):
    """The agreement of a network with an equation."""

    error: float  # root mean square of Q minus target, as a share of the spread of Q
    correlation: float  # of the advantages of Q with those of the target
    advantages: float  # spread of the advantages of Q, over that of the right targets
    position: float  # of Q on the way from the right targets, 0, to these, 1


def agreement(values: Backup, target: Array) -> Agreement:
    """Returns how well the values agree with targets [N, A]."""
    learned, right = advantages(values.q).std(), advantages(values.right).std()
    way, error = target - values.right, values.q - values.right
    return Agreement(
        float(np.sqrt(np.mean((values.q - target) ** 2)) / max(values.q.std(), 1e-12)),
        line_fit(advantages(values.q), advantages(target)).correlation,
        float(learned / max(right, 1e-12)),
        float((way * error).sum() / max((way**2).sum(), 1e-12)),
    )
