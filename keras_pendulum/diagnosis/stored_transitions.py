"""The findings of stored transitions: their rewards, and mistakes of their states."""

from __future__ import annotations

import numpy as np

from keras_pendulum.diagnosis.faults import Fault, Finding
from keras_pendulum.diagnosis.measurement import Measurement
from keras_pendulum.diagnosis.run_record import RunRecord
from keras_pendulum.diagnosis.signals import Array, Fit, distances, line_fit

_MOST_REWARDS = 4000  # that are compared with each other
_MOST_STEPS = 20  # of one transition

OLD_STATE = Fault(
    "The state is not updated: each action of an episode is chosen at its first state. So the "
    "network sees one state of each episode.",
    "Set the state to the next state at the end of each step.",
)


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


def constant_number(m: Measurement, r: RunRecord) -> Finding | None:
    """Finds a number of the observation that is the same in all transitions."""
    names, observation = m.task.observation_names, r.replay.observation
    same = [name for name, column in zip(names, observation.T, strict=True) if not np.ptp(column)]
    if not same:
        return None
    return Finding(
        "observation-map",
        f"{', '.join(same)} is the same number in all stored transitions",
        "numbers that differ",
        text=Fault(
            "A part of the observation is lost before it is stored. So the network cannot learn "
            "what depends on it.",
            "Store the observation as the environment gives it, and print some of its rows.",
        ),
        proven=True,
    )


def repeated_state(r: RunRecord) -> Finding | None:
    """Finds a state that is not updated."""
    replay = r.replay
    unmoved = np.mean(np.all(replay.observation == replay.next_observation, axis=1))
    if unmoved > 0.5:
        return Finding(
            "misaligned-transitions",
            f"in {unmoved:.0%} of the stored transitions the next state is the state",
            "none",
            variant="same-state",
            text=Fault(
                "The next state is stored as the state itself, so no action has a consequence.",
                "Store (s, a, r, s′) before s = s′, and copy the observation where the environment "
                "changes it in place.",
            ),
        )
    # A transition that is stored twice is no mistake.
    twice, same = (
        np.all(each[1:] == each[:-1], axis=1)
        for each in (replay.next_observation, replay.observation)
    )
    repeated = np.mean(same & ~twice)
    if repeated > 0.5:
        return Finding(
            "misaligned-transitions",
            f"{repeated:.0%} of the stored transitions begin with the state of the one before",
            "none",
            variant="same-state",
            text=OLD_STATE,
        )
    return None


def has_several_steps(r: RunRecord) -> bool:
    """Returns whether the next state of a transition is the state a few rows later."""
    observation, following = r.replay.observation, r.replay.next_observation
    return any(
        np.all(following[:-steps] == observation[steps:], axis=1).mean() > 0.5
        for steps in range(2, _MOST_STEPS + 1)
    )
