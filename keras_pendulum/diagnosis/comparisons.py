"""The learned values compared with the exact ones of other tasks and of other observations."""

from __future__ import annotations

from itertools import permutations, product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.diagnosis.measurement import Measurement
from keras_pendulum.diagnosis.other_tasks import other_value
from keras_pendulum.diagnosis.run_record import RunRecord
from keras_pendulum.diagnosis.signals import (
    Array,
    advantage_fit,
    line_fit,
    output_torques,
    value_fit,
)
from keras_pendulum.diagnosis.states import observe
from keras_pendulum.environments.pendulum import Pendulum
from keras_pendulum.optimum.discounted import exact_q


class Match(NamedTuple):
    """The match of learned values with those of one hypothesis; 1 is a perfect match."""

    score: float  # product of the values' and the advantages' correlation, 0 where one is negative
    scaled_score: float  # times the slope of the values, or its inverse: the right task has 1


def match(learned: Array, exact: Array) -> Match:
    """Returns the match of learned and exact Q-values, both [N, A]."""
    value, advantage = value_fit(learned, exact), advantage_fit(learned, exact)
    score = max(0.0, value.correlation) * max(0.0, advantage.correlation)
    size = min(value.slope, 1 / value.slope) if value.slope > 0 else 0.0
    return Match(score, score * size)


def match_task(m: Measurement, gravity: float, discount: float) -> Match:
    """Returns the match with a task of `other_value`."""
    table, (theta, speed) = other_value(gravity, discount), m.states.T
    return match(m.learned_q, exact_q(table, gravity, discount, theta, speed, m.torques))


def _observation_changes() -> dict[str, NDArray[np.float32]]:
    names, identity = Pendulum.observation_names, np.eye(3, dtype=np.float32)
    changes = {}
    for order in permutations(range(3)):
        for signs in product((1, -1), repeat=3):
            name = ", ".join(
                ("-" if sign < 0 else "") + names[i] for i, sign in zip(order, signs, strict=True)
            )
            changes[name] = identity[:, list(order)] * np.array(signs, np.float32)
    # Both signs turned is the reversed torque: the pendulum is symmetric.
    for name in ("cos θ, sin θ, θ̇", "cos θ, -sin θ, -θ̇"):
        del changes[name]
    for name, factor in (("θ̇·π/180", np.pi / 180), ("θ̇·180/π", 180 / np.pi), ("θ̇/8", 1 / 8)):
        changes[f"cos θ, sin θ, {name}"] = np.diag(np.array([1, 1, factor], np.float32))
    return changes


# Matrices [3, 3] that undo a wrong order, sign or unit of the observation, by name.
OBSERVATION_CHANGES = _observation_changes()


def match_observations(m: Measurement) -> dict[str, Match]:
    """Returns the match with each change of the observation."""
    observations, exact = observe(m.states[:500]), m.exact_q[:500]
    return {
        name: match(m.q_values(observations @ change), exact)
        for name, change in OBSERVATION_CHANGES.items()
    }


def matched_correlation(m: Measurement) -> float:
    """Returns the correlation of the advantages with rank-matched outputs.

    The order comes from the even states, the correlation from the odd ones.
    """
    found = output_torques(m.learned_q[::2], m.exact_q[::2], m.torques)
    order = np.argsort(found, kind="stable")
    exact = m.exact_q[1::2][:, np.argsort(m.torques)]
    return advantage_fit(m.learned_q[1::2][:, order], exact).correlation


class ActionMatch(NamedTuple):
    """The correlation of the torques that an agent chooses with those that its run stored."""

    declared: float  # of the agent as it is
    torques: Array  # [A]: the torque that the run stored most often where an output is chosen
    by_torques: float  # with these torques, on transitions that did not choose them
    observation: str  # the change of the observation that matches best
    by_observation: float  # with this change


def match_actions(m: Measurement) -> ActionMatch | None:
    """Returns the match with the last 1000 stored actions, which a run chooses greedily.

    Returns None without 200 of them.
    """
    if m.record is None or len(m.record.replay.action) < 200:
        return None
    observations, torques = m.record.replay.observation[-1000:], m.torques
    stored = m.record.replay.action[-1000:]

    def match_stored(acted: Array) -> float:
        return line_fit(acted, torques[stored]).correlation

    chosen = m.q_values(observations).argmax(axis=1)
    counts = np.zeros((len(torques), len(torques)), np.intp)
    np.add.at(counts, (chosen[::2], stored[::2]), 1)
    found = np.where(counts.any(axis=1), torques[counts.argmax(axis=1)], torques)
    by_change = {
        name: match_stored(m.act(observations @ change))
        for name, change in OBSERVATION_CHANGES.items()
    }
    best = max(by_change, key=lambda name: by_change[name])
    return ActionMatch(
        match_stored(m.act(observations)),
        found,
        line_fit(found[chosen[1::2]], torques[stored[1::2]]).correlation,
        best,
        by_change[best],
    )


def stored_errors(m: Measurement, record: RunRecord) -> tuple[float, float]:
    """Returns the errors of the stored actions' values, as shares of the rewards' spread.

    The first error is that to the stored rewards, the second that to the targets of the declared
    discount.
    """
    replay = record.replay
    reward = replay.reward / record.config.reward_scale
    learned = m.q_values(replay.observation)[np.arange(len(reward)), replay.action]
    target = reward + m.discount * m.q_values(replay.next_observation).max(axis=1)
    spread = max(float(reward.std()), 1e-9)
    errors = [float(np.sqrt(np.mean((learned - truth) ** 2))) for truth in (reward, target)]
    return errors[0] / spread, errors[1] / spread
