"""The measurement of an agent: its signals at the states of its task, and its episodes."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.diagnose import signals
from keras_pendulum.diagnose.signals import Fit
from keras_pendulum.diagnose.states import (
    Episodes,
    observe,
    plane_states,
    simulate,
    training_states,
)
from keras_pendulum.diagnose.subject import Array, Subject
from keras_pendulum.dqn.policy import activations_of
from keras_pendulum.environments.tasks import pendulum_starts
from keras_pendulum.evaluate.evaluation import random_return
from keras_pendulum.optimum.discounted import discounted_return, discounted_value, exact_q
from keras_pendulum.optimum.dynamics import TORQUES, step_all_torques
from keras_pendulum.optimum.optimal_return import optimal_return

STARTS = 60  # seeds 0, 1, …


@dataclass(frozen=True)
class Measurement:
    """The signals of one agent. Those of Q-values are only there where the agent has them."""

    subject: Subject
    table: NDArray[np.float32] = field(repr=False)  # exact V of the declared task

    @cached_property
    def starts(self) -> Array:
        """The starts [B, 2] of the episodes."""
        return pendulum_starts(range(STARTS))

    @cached_property
    def episodes(self) -> Episodes:
        """The agent's episodes."""
        return simulate(self.subject.act, self.subject.gravity, self.starts)

    @cached_property
    def optimum(self) -> float:
        """The mean optimal return of the starts."""
        return float(optimal_return(self.subject.gravity, range(STARTS)).mean())

    @cached_property
    def discount_cost(self) -> float:
        """The regret of the exact policy for the declared discount."""
        returns = discounted_return(self.subject.gravity, self.subject.discount, range(STARTS))
        return max(0.0, self.optimum - float(returns.mean()))

    @cached_property
    def regret(self) -> float:
        """The mean optimal return minus the agent's."""
        return self.optimum - float(self.episodes.returns.mean())

    @cached_property
    def little(self) -> float:
        """The regret that counts as little: 1 % of the way from random torques to the optimum.

        What the discount costs comes on top, because no training can win it back.
        """
        way = self.optimum - random_return("Pendulum-v1", self.subject.gravity, 200)
        return 0.01 * max(way, 1.0) + self.discount_cost

    def exact(self, states: Array) -> Array:
        """Returns the exact Q-values [N, A] of the declared task for the agent's outputs."""
        subject = self.subject
        assert subject.torques is not None
        return exact_q(
            self.table,
            subject.gravity,
            subject.discount,
            states[:, 0],
            states[:, 1],
            subject.torques,
        )

    @cached_property
    def states(self) -> Array:
        """States [N, 2] that a run of this task meets."""
        subject = self.subject
        return training_states(self.table, subject.gravity, subject.discount, self.starts)

    @cached_property
    def learned_q(self) -> Array:
        """The learned Q-values [N, A] at `states`."""
        return self.subject.q_values(observe(self.states))

    @cached_property
    def exact_q(self) -> Array:
        """The exact Q-values [N, A] at `states`."""
        return self.exact(self.states)

    @cached_property
    def finite(self) -> bool:
        """Whether the learned values are finite."""
        return bool(np.isfinite(self.learned_q).all())

    @cached_property
    def value(self) -> Fit:
        """The fit of the states' values."""
        return signals.value_fit(self.learned_q, self.exact_q)

    @cached_property
    def advantage(self) -> Fit:
        """The fit of the advantages."""
        return signals.advantage_fit(self.learned_q, self.exact_q)

    @cached_property
    def plane_value(self) -> Fit:
        """The fit of the values on the whole plane."""
        states = plane_states()
        return signals.value_fit(self.subject.q_values(observe(states)), self.exact(states))

    @cached_property
    def advantage_size(self) -> float:
        """The spread of the learned advantages as a multiple of that of the exact ones."""
        exact = signals.advantages(self.exact_q).std()
        return float(signals.advantages(self.learned_q).std() / max(exact, 1e-12))

    @cached_property
    def output_torques(self) -> Array:
        """The torque [A] that each output behaves like, in N·m."""
        assert self.subject.torques is not None
        found = signals.output_torques(self.learned_q, self.exact_q, self.subject.torques)
        return found / (self.value.slope or 1.0)

    @cached_property
    def outliers(self) -> Array:
        """The robust z-score [A] of each output's mean error."""
        return signals.output_outliers(self.learned_q, self.exact_q)

    @cached_property
    def asymmetry(self) -> float:
        """The asymmetry of the learned values."""
        return signals.asymmetry(self.learned_q, self.subject.q_values(observe(-self.states)))

    @cached_property
    def td_error(self) -> float:
        """The root mean square of the exact TD error, as a share of the spread of exact values."""
        subject, states = self.subject, self.states[:400]
        assert subject.torques is not None
        reward, theta, speed = step_all_torques(
            subject.gravity, states[:, 0], states[:, 1], subject.torques
        )
        flat = np.stack([theta.ravel(), speed.ravel()], axis=1)
        best = subject.q_values(observe(flat)).max(axis=1).reshape(reward.shape)
        error = reward + subject.discount * best - subject.q_values(observe(states))
        return float(np.sqrt(np.mean(error**2)) / self.exact_q.mean(axis=1).std())

    @cached_property
    def predicted(self) -> float:
        """The highest learned value of the starts, on average."""
        return float(self.subject.q_values(observe(self.starts)).max(axis=1).mean())

    @cached_property
    def collected(self) -> float:
        """The discounted return that the agent collects from the starts, on average."""
        return float(self.episodes.discounted(self.subject.discount).mean())

    @cached_property
    def excess(self) -> float:
        """Returns the distance of the highest learned value above the optimum, in spreads."""
        excess = self.learned_q.max(axis=1) - self.exact_q.max(axis=1)
        return float(np.median(excess)) / self.value_spread

    @cached_property
    def promise(self) -> float:
        """The median of the highest learned value minus what the agent collects, in spreads.

        The states are those of the first half of the agent's episodes.
        """
        episodes, half = self.episodes, len(self.episodes.rewards) // 2
        collected = episodes.returns_to_go(self.subject.discount)[:half:5]
        learned = self.subject.q_values(observe(episodes.states[:half:5].reshape(-1, 2)))
        return float(np.median(learned.max(axis=1) - collected.ravel())) / self.value_spread

    @cached_property
    def value_spread(self) -> float:
        """The standard deviation of the exact values at `states`."""
        return float(self.exact_q.mean(axis=1).std())

    @cached_property
    def regions(self) -> dict[str, float]:
        """The median error of the values by region, as a share of their spread."""
        error = signals.relative_error(self.learned_q, self.exact_q)
        theta, speed = self.states.T
        angle = np.abs((theta + np.pi) % (2 * np.pi) - np.pi)
        upright = (angle < 0.5) & (np.abs(speed) < 1.5)
        parts = {
            "near upright": upright,
            "upper half": (angle < np.pi / 2) & ~upright,
            "lower half": angle >= np.pi / 2,
        }
        return {
            name: float(np.median(error[where])) if where.any() else 0.0
            for name, where in parts.items()
        }

    @cached_property
    def units(self) -> tuple[float, float]:
        """The shares of saturated tanh outputs and of dead ReLU units; 0 without a network."""
        network = self.subject.network
        if network is None:
            return 0.0, 0.0
        weights = network.get_weights()
        names = activations_of(network.activation, len(weights) // 2 - 1)
        hidden, features = [], observe(self.states)
        for kernel, bias, name in zip(weights[:-2:2], weights[1:-2:2], names, strict=True):
            features = features @ kernel + bias
            if name != "linear":
                features = np.tanh(features) if name == "tanh" else np.maximum(features, 0)
            hidden.append(features)
        return signals.saturation(hidden, names)

    @cached_property
    def torque_use(self) -> Array:
        """The share [41] of each torque of the usual grid in the agent's episodes."""
        indices = np.abs(self.episodes.torques[..., None] - TORQUES).argmin(axis=-1)
        return np.bincount(indices.ravel(), minlength=len(TORQUES)) / indices.size


def measure(subject: Subject) -> Measurement:
    """Returns the measurement of an agent. The exact values of its task are solved or loaded."""
    return Measurement(subject, discounted_value(subject.gravity, subject.discount))
