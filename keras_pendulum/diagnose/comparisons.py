"""The learned values compared with the exact ones of other tasks and of other observations."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.diagnose.measurement import Measurement
from keras_pendulum.diagnose.other_tasks import DISCOUNTS, GRAVITIES, other_value
from keras_pendulum.diagnose.run_record import RunRecord
from keras_pendulum.diagnose.signals import Array, advantage_fit, line_fit, value_fit
from keras_pendulum.diagnose.states import observe
from keras_pendulum.diagnose.subject import Subject
from keras_pendulum.dqn.replay_buffer import Transitions
from keras_pendulum.optimum.discounted import exact_q

Change = Callable[[NDArray[np.float32]], NDArray[np.float32]]


@dataclass(frozen=True)
class Match:
    """The match of learned values with those of one hypothesis; 1 is a perfect match."""

    slope: float  # of the values
    value: float  # correlation of the values
    advantage: float  # correlation of the advantages

    @property
    def score(self) -> float:
        """The product of both correlations, 0 where one is negative."""
        return max(0.0, self.value) * max(0.0, self.advantage)

    @property
    def scaled_score(self) -> float:
        """The score times the slope, or its inverse: the right task has the slope 1."""
        size = min(self.slope, 1 / self.slope) if self.slope > 0 else 0.0
        return self.score * size


def match(learned: Array, exact: Array) -> Match:
    """Returns the match of learned and exact Q-values, both [N, A]."""
    value = value_fit(learned, exact)
    return Match(value.slope, value.correlation, advantage_fit(learned, exact).correlation)


def match_discounts(measurement: Measurement) -> dict[float, Match]:
    """Returns the match with each other discount at the declared gravity."""
    gravity = _nearest(GRAVITIES, measurement.subject.gravity)
    if gravity != measurement.subject.gravity:
        return {}  # the tables contain no other discount of this gravity
    return {discount: _match_task(measurement, gravity, discount) for discount in DISCOUNTS}


def match_gravities(measurement: Measurement) -> dict[float, Match]:
    """Returns the match with each other gravity at the discount nearest to the declared one."""
    discount = _nearest(DISCOUNTS, measurement.subject.discount)
    return {gravity: _match_task(measurement, gravity, discount) for gravity in GRAVITIES}


def reward_q(measurement: Measurement) -> Array:
    """Returns the rewards of one step, [N, A]: the exact Q-values for γ = 0."""
    torques = measurement.subject.torques
    assert torques is not None
    theta, speed = measurement.states.T
    table, gravity = other_value(0.0, 0.0), measurement.subject.gravity
    return exact_q(table, gravity, 0.0, theta, speed, torques)


_NAMES = ("cos θ", "sin θ", "θ̇")


def observation_changes() -> dict[str, Change]:
    """Returns changes that undo a wrong order, sign or unit of the observation, by name."""
    changes: dict[str, Change] = {}
    for order in permutations(range(3)):
        for signs in product((1, -1), repeat=3):
            name = ", ".join(
                ("-" if sign < 0 else "") + _NAMES[i] for i, sign in zip(order, signs, strict=True)
            )
            # Both signs turned is the reversed torque: the pendulum is symmetric.
            if name not in (", ".join(_NAMES), "cos θ, -sin θ, -θ̇"):
                changes[name] = _reorder(order, signs)
    for name, factor in (("θ̇·π/180", np.pi / 180), ("θ̇·180/π", 180 / np.pi), ("θ̇/8", 1 / 8)):
        changes[f"cos θ, sin θ, {name}"] = _scale(factor)
    return changes


def match_observations(measurement: Measurement) -> dict[str, Match]:
    """Returns the match with each change of the observation."""
    observations = observe(measurement.states[:500])
    exact = measurement.exact_q[:500]
    subject = measurement.subject
    return {
        name: match(subject.q_values(change(observations)), exact)
        for name, change in observation_changes().items()
    }


@dataclass(frozen=True)
class ActionMatch:
    """The correlation of the torques that an agent chooses with those that its run stored."""

    declared: float  # of the agent as it is
    torques: Array  # [A]: the torque that the run stored most often where an output is chosen
    by_torques: float  # with these torques, on transitions that did not choose them
    observation: str  # the change of the observation that matches best
    by_observation: float  # with this change


def match_actions(measurement: Measurement, replay: Transitions) -> ActionMatch:
    """Returns the match with the last 1000 stored actions, which a run chooses greedily."""
    subject = measurement.subject
    torques = subject.torques
    assert torques is not None
    observations, stored = replay.observation[-1000:], replay.action[-1000:]

    def match_torques(changed: Subject) -> float:
        return line_fit(changed.act(observations), torques[stored]).correlation

    chosen = subject.q_values(observations).argmax(axis=1)
    counts = np.zeros((len(torques), len(torques)), np.intp)
    np.add.at(counts, (chosen[::2], stored[::2]), 1)
    found = np.where(counts.any(axis=1), torques[counts.argmax(axis=1)], torques)
    by_change = {
        name: match_torques(subject.with_observations(change))
        for name, change in observation_changes().items()
    }
    best = max(by_change, key=lambda name: by_change[name])
    return ActionMatch(
        match_torques(subject),
        found,
        line_fit(found[chosen[1::2]], torques[stored[1::2]]).correlation,
        best,
        by_change[best],
    )


def stored_errors(measurement: Measurement, record: RunRecord) -> tuple[float, float]:
    """Returns the errors of the stored actions' values, as shares of the rewards' spread.

    The first error is that to the stored rewards, the second that to the targets of the declared
    discount.
    """
    subject, replay = measurement.subject, record.replay
    reward = replay.reward / record.config.reward_scale
    learned = subject.q_values(replay.observation)[np.arange(len(reward)), replay.action]
    target = reward + subject.discount * subject.q_values(replay.next_observation).max(axis=1)
    spread = max(float(reward.std()), 1e-9)
    return (
        float(np.sqrt(np.mean((learned - reward) ** 2))) / spread,
        float(np.sqrt(np.mean((learned - target) ** 2))) / spread,
    )


def _match_task(measurement: Measurement, gravity: float, discount: float) -> Match:
    torques = measurement.subject.torques
    assert torques is not None
    theta, speed = measurement.states.T
    table = other_value(gravity, discount)
    exact = exact_q(table, gravity, discount, theta, speed, torques)
    return match(measurement.learned_q, exact)


def _nearest(grid: tuple[float, ...], number: float) -> float:
    return min(grid, key=lambda each: abs(each - number))


def _reorder(order: tuple[int, ...], signs: tuple[int, ...]) -> Change:
    factors = np.array(signs, np.float32)
    return lambda observations: observations[:, list(order)] * factors


def _scale(factor: float) -> Change:
    factors = np.array([1, 1, factor], np.float32)
    return lambda observations: observations * factors
