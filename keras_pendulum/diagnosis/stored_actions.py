"""The actions of an agent, compared with those that its run stored."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from keras_pendulum.diagnosis.measurement import Measurement
from keras_pendulum.diagnosis.signals import Array, line_fit
from keras_pendulum.diagnosis.states import observation_changes

SAME_ACTIONS = 0.8  # correlation of an agent's efforts with those that its run stored


class ActionMatch(NamedTuple):
    """The correlation of the efforts that an agent chooses with those that its run stored."""

    declared: float  # of the agent as it is
    efforts: Array  # [A]: the effort that the run stored most often where an output is chosen
    by_efforts: float  # with these efforts, on transitions that did not choose them
    observation: str  # the change of the observation that matches best
    by_observation: float  # with this change


def match_actions(m: Measurement) -> ActionMatch | None:
    """Returns the match with the last 1000 stored actions, which a run chooses greedily.

    Returns None without 200 of them.
    """
    if m.record is None or len(m.record.replay.action) < 200:
        return None
    observations, efforts = m.record.replay.observation[-1000:], m.efforts
    stored = m.record.replay.action[-1000:]

    def match_stored(acted: Array) -> float:
        return line_fit(acted, efforts[stored]).correlation

    chosen = m.q_values(observations).argmax(axis=1)
    counts = np.zeros((len(efforts), len(efforts)), np.intp)
    np.add.at(counts, (chosen[::2], stored[::2]), 1)
    found = np.where(counts.any(axis=1), efforts[counts.argmax(axis=1)], efforts)
    by_change = {
        name: match_stored(m.act(observations @ change))
        for name, change in observation_changes(m.dynamics).items()
    }
    best = max(by_change, key=lambda name: by_change[name])
    return ActionMatch(
        match_stored(m.act(observations)),
        found,
        line_fit(found[chosen[1::2]], efforts[stored[1::2]]).correlation,
        best,
        by_change[best],
    )
