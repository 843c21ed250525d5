"""Both sides of an equation for the values of a network, and how well they agree."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.diagnosis.signals import Array, Fit, advantage_fit, advantages, line_fit
from keras_pendulum.environments.pendulum import MAX_SPEED


class Backup(NamedTuple):
    """The values of a network at N states and at all states that can follow them."""

    q: Array  # [N, A]
    reward: Array  # [N, A]
    next_q: Array  # [N, A, A]: the last axis is the action of the next step
    discount: float  # γ
    next_observation: NDArray[np.float32]  # [N · A, D]
    continues: NDArray[np.bool_]  # [N, A]: whether the step does not terminate the episode
    reward_scale: float = 1.0  # the program's outputs are the values times this factor

    @property
    def right(self) -> Array:
        """The right targets [N, A]."""
        return np.asarray(self.reward + self.future * self.next_q.max(axis=2))

    @property
    def future(self) -> Array:
        """The factor [N, A] on the next values: γ, or 0 where the step terminates the episode."""
        factor: Array = self.discount * self.continues.astype(np.float64)
        return factor

    @property
    def spread(self) -> float:
        """The standard deviation of the values.

        Where episodes terminate, it is at least a part of their size: there, the values of a wrong
        program may be the same everywhere.
        """
        least = 0.0
        if not self.continues.all():
            least = max(0.1 * np.abs(self.reward).mean(), 0.02 * np.abs(self.q).mean())
        return max(float(self.q.std()), float(least), 1e-12)

    @property
    def offset(self) -> Array:
        """The values minus the rewards of one step, of the steps that do not terminate, [M]."""
        return (self.q - self.reward)[self.continues]

    @property
    def offset_is_smooth(self) -> bool:
        """Whether `offset` is nearly linear in the next observation and in some absolute values.

        These are the speed of the pendulum, and the angle and the speed of the pole. So is the
        value of a network that has never learned.
        """
        observed = self.next_observation[self.continues.ravel()].astype(float)
        causes = np.column_stack([np.ones(len(observed)), observed, np.abs(observed[:, 2:])])
        offset = self.offset
        solution, *_ = np.linalg.lstsq(causes, offset, rcond=None)
        unexplained = 0.4 if causes.shape[1] == 5 else 0.15  # more causes explain more by chance
        return bool((offset - causes @ solution).var() < unexplained * offset.var())

    @property
    def offset_at_zero(self) -> float:
        """The mean of `offset` where the next observation is nearest to 0, a tenth of the steps.

        For a network that has never learned, it is little: there, its biases alone make the values.
        """
        observed = self.next_observation[self.continues.ravel()]
        distance = np.linalg.norm(observed / observed.std(axis=0), axis=1)
        return float(self.offset[distance <= np.quantile(distance, 0.1)].mean())

    @property
    def offset_by_next_state(self) -> Array:
        """The part of `offset` [M] that a polynomial of the pendulum's next observation gives."""
        cosine, sine, speed = self.next_observation[self.continues.ravel()].astype(float).T
        speed = speed / MAX_SPEED
        powers = [(i, j) for i in range(6) for j in range(6 - i)]
        even = np.column_stack([sine**i * speed**j for i, j in powers])
        odd = np.column_stack([cosine * sine**i * speed**j for i, j in powers if i + j < 5])
        terms = np.column_stack([even, odd])  # cos² is 1 - sin²
        solution, *_ = np.linalg.lstsq(terms, self.offset, rcond=None)
        return np.asarray(terms @ solution)

    @property
    def index_correlation(self) -> float:
        """The correlation of `offset` with the index of the best next action."""
        return line_fit(self.offset, self.next_q.argmax(axis=2)[self.continues]).correlation

    @property
    def reward_line(self) -> Fit:
        """The line over the rewards that obeys the right equation best in their place.

        Its correlation is that of the advantages of the values and of their targets.
        """
        future = self.future * self.next_q.max(axis=2)
        line = line_fit(self.q - future, self.reward)
        target = line.slope * self.reward + line.offset + future
        correlation = advantage_fit(self.q, target).correlation
        return line._replace(correlation=correlation)

    @property
    def reward_factor(self) -> float:
        """The factor on the rewards with which the values obey the right equation best."""
        rest = self.q - self.future * self.next_q.max(axis=2)
        return float((rest * self.reward).sum() / max((self.reward**2).sum(), 1e-12))


class Agreement(NamedTuple):
    """The agreement of a network with an equation."""

    error: float  # root mean square of Q minus target, as a share of the spread of Q
    correlation: float  # of the advantages of Q with those of the target
    advantages: float  # spread of the advantages of Q, over that of the right targets
    position: float  # of Q on the way from the right targets, 0, to these, 1
    mean: float = 0.0  # of Q
    at_ends: float = 0.0  # mean of Q where the step ends the episode, as a share of the mean


def agreement(values: Backup, target: Array) -> Agreement:
    """Returns how well the values agree with targets [N, A]."""
    learned, right = advantages(values.q).std(), advantages(values.right).std()
    has_ends = not values.continues.all()
    way, error = target - values.right, values.q - values.right
    return Agreement(
        float(np.sqrt(np.mean((values.q - target) ** 2)) / values.spread),
        advantage_fit(values.q, target).correlation,
        float(learned / max(right, 1e-12)),
        float((way * error).sum() / max((way**2).sum(), 1e-12)),
        float(values.q.mean()),
        float(values.q[~values.continues].mean() / values.q.mean()) if has_ends else 0.0,
    )
