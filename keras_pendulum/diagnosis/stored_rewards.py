"""The rewards of stored transitions, compared with the exact ones."""

from __future__ import annotations

import numpy as np

from keras_pendulum.diagnosis.measurement import Measurement
from keras_pendulum.diagnosis.run_record import RunRecord
from keras_pendulum.diagnosis.signals import Array, Fit, distances, line_fit

_MOST_REWARDS = 4000  # that are compared with each other


class StoredRewards:
    """The stored rewards [N] of a run, in units of the declared ones, and the exact ones.

    Args:
        m: the agent, with the record of its run.
        record: this record.
    """

    def __init__(self, m: Measurement, record: RunRecord) -> None:
        self.record, self.sizes = record, m.dynamics.observation_sizes
        self.stored: Array = record.replay.reward.astype(np.float64) / m.reward_scale
        states = m.dynamics.states_of(record.replay.observation)
        acted = record.stored_efforts(m.efforts)[:, None]
        self.exact = m.dynamics.outcomes(states, acted).reward[:, 0]

    @property
    def fit(self) -> Fit:
        """The line through stored over exact rewards; constant ones that are equal fit, too.

        Constant ones are those of CartPole. There, many programs give the last step a penalty,
        which is no mistake.
        """
        if not np.ptp(self.exact):
            goes_on = ~self.record.replay.terminated
            stored = self.stored[goes_on] if goes_on.any() else self.stored
            slope = float(np.median(stored) / self.exact[0])
            close = np.abs(stored - slope * self.exact[0]) < 0.01 * abs(slope)
            return Fit(slope, 0.0, float(np.sign(slope) * close.mean()))
        return line_fit(self.stored, self.exact)

    @property
    def shifted_correlation(self) -> float:
        """The correlation with the exact rewards of the step before."""
        follows = self.record.follows
        return line_fit(self.stored[1:][follows], self.exact[:-1][follows]).correlation

    @property
    def follow_states(self) -> bool:
        """Whether they differ from the exact ones by what the state says, not by noise.

        In nearly the same states, the differences are then nearly the same.
        """
        exact = self.exact[-_MOST_REWARDS:]
        stored = self.stored[-_MOST_REWARDS:]
        rest = stored - line_fit(stored, exact).slope * exact
        observations = self.record.replay.observation[-_MOST_REWARDS:]
        some = np.random.RandomState(0).permutation(len(rest))[:500]
        distance = distances(observations, self.sizes, some)
        distance[np.arange(len(some)), some] = np.inf
        return line_fit(rest[some], rest[distance.argmin(axis=1)]).correlation > 0.5
