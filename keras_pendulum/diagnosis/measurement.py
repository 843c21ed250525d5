"""The measurement of an agent: its signals at the states of its task, and its episodes."""

from __future__ import annotations

import copy
import pickle
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.diagnosis import signals
from keras_pendulum.diagnosis.run_record import RunRecord
from keras_pendulum.diagnosis.signals import Array, Fit
from keras_pendulum.diagnosis.states import (
    Episodes,
    observe,
    plane_states,
    simulate,
    training_states,
)
from keras_pendulum.dqn.policy import ACTIVATIONS, activations_of
from keras_pendulum.environments.actions import TorqueActions
from keras_pendulum.environments.pendulum import Pendulum, pendulum_starts
from keras_pendulum.evaluate.policy import Observations, Policy
from keras_pendulum.evaluate.q_policies import DQNPolicy
from keras_pendulum.optimum.discounted import discounted_value, exact_q
from keras_pendulum.optimum.dynamics import step_all_torques
from keras_pendulum.optimum.optimal_return import discounted_return, optimal_return
from keras_pendulum.optimum.solutions import solution

STARTS = 60  # seeds 0, 1, …


@dataclass(frozen=True)
class Measurement:
    """The signals of a policy on its declared task, each computed when it is first used.

    Those of Q-values are only there where the policy has them.
    """

    policy: Policy
    task: Pendulum
    discount: float  # γ
    reward_scale: float = 1.0  # declared factor on the rewards
    record: RunRecord | None = None  # of the run that trained the policy

    @property
    def torques(self) -> Array:
        """The torques [A] of the outputs in N·m."""
        actions = self.policy.actions
        assert isinstance(actions, TorqueActions)
        return actions.torques

    def without_code(self) -> Measurement:
        """Returns a copy whose policy has no part that pickle refuses, such as a local function."""
        copied, policy = copy.copy(self), copy.copy(self.policy)
        for name, value in vars(policy).items():
            try:
                pickle.dumps(value)
            except Exception:  # which one depends on the value
                setattr(policy, name, None)
        vars(copied)["policy"] = policy
        return copied

    def act(self, observations: Observations) -> Array:
        """Returns the torques [B] in N·m."""
        return np.asarray(self.policy.act(observations)[:, 0])

    def q_values(self, observations: Observations) -> Array:
        """Returns the learned Q-values [B, A] in units of return."""
        with np.errstate(all="ignore"):
            q = np.asarray(self.policy.q_values(observations), np.float64)
        return q / self.reward_scale

    @cached_property
    def starts(self) -> Array:
        """The starts [B, 2] of the episodes."""
        return pendulum_starts(range(STARTS))

    @cached_property
    def episodes(self) -> Episodes:
        """The agent's episodes."""
        return simulate(self.act, self.task.gravity, self.starts)

    @cached_property
    def optimum(self) -> float:
        """The mean optimal return of the starts."""
        return float(optimal_return(self.task.gravity, range(STARTS)).mean())

    @cached_property
    def discount_cost(self) -> float:
        """The regret of the exact policy for the declared discount."""
        returns = discounted_return(self.task.gravity, self.discount, range(STARTS))
        return max(0.0, self.optimum - float(returns.mean()))

    @cached_property
    def regret(self) -> float:
        """The mean optimal return minus the agent's."""
        return self.optimum - float(self.episodes.returns.mean())

    @cached_property
    def regret_tolerance(self) -> float:
        """The regret that needs no finding: 1 % of the way from random torques to the optimum.

        What the discount costs comes on top, because no training can win it back.
        """
        way = self.optimum - solution(self.task).random_return()
        return 0.01 * max(way, 1.0) + self.discount_cost

    @cached_property
    def table(self) -> NDArray[np.float32]:
        """V of the declared task, as `discounted_value` returns it."""
        return discounted_value(self.task.gravity, self.discount)

    @cached_property
    def states(self) -> Array:
        """States [N, 2] that a run of this task meets."""
        return training_states(self.table, self.task.gravity, self.discount, self.starts)

    @cached_property
    def learned_q(self) -> Array:
        """The learned Q-values [N, A] at `states`."""
        return self.q_values(observe(self.states))

    @cached_property
    def exact_q(self) -> Array:
        """The exact Q-values [N, A] at `states`."""
        return self._exact_q(self.states)

    def _exact_q(self, states: Array) -> Array:
        theta, speed = states.T
        return exact_q(self.table, self.task.gravity, self.discount, theta, speed, self.torques)

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
        return signals.value_fit(self.q_values(observe(states)), self._exact_q(states))

    @cached_property
    def advantage_size(self) -> float:
        """The spread of the learned advantages as a multiple of that of the exact ones."""
        exact = signals.advantages(self.exact_q).std()
        return float(signals.advantages(self.learned_q).std() / max(exact, 1e-12))

    @cached_property
    def output_torques(self) -> Array:
        """The torque [A] that each output behaves like, in N·m."""
        found = signals.output_torques(self.learned_q, self.exact_q, self.torques)
        return found / (self.value.slope or 1.0)

    @cached_property
    def outliers(self) -> Array:
        """The robust z-score [A] of each output's mean error."""
        return signals.output_outliers(self.learned_q, self.exact_q)

    @cached_property
    def asymmetry(self) -> float:
        """The root mean square of Q(s, u) - Q(-s, -u), as a share of the spread of Q."""
        q, mirrored_q = self.learned_q, self.q_values(observe(-self.states))[:, ::-1]
        spread = q.std()
        return float(np.sqrt(np.mean((q - mirrored_q) ** 2)) / spread) if spread > 0 else 0.0

    @cached_property
    def td_error(self) -> float:
        """The root mean square of the exact TD error, as a share of the spread of exact values."""
        states = self.states[:400]
        reward, theta, speed = step_all_torques(
            self.task.gravity, states[:, 0], states[:, 1], self.torques
        )
        following = np.stack([theta.ravel(), speed.ravel()], axis=1)
        best = self.q_values(observe(following)).max(axis=1).reshape(reward.shape)
        error = reward + self.discount * best - self.q_values(observe(states))
        return float(np.sqrt(np.mean(error**2)) / self.value_spread)

    @cached_property
    def excess(self) -> float:
        """The distance of the highest learned value above the optimum, in spreads."""
        excess = self.learned_q.max(axis=1) - self.exact_q.max(axis=1)
        return float(np.median(excess)) / self.value_spread

    @cached_property
    def value_overestimate(self) -> float:
        """The median of the highest learned value minus what the agent collects, in spreads.

        The states are those of the first half of the agent's episodes.
        """
        episodes, half = self.episodes, len(self.episodes.rewards) // 2
        collected = episodes.returns_to_go(self.discount)[:half:5]
        learned = self.q_values(observe(episodes.states[:half:5].reshape(-1, 2)))
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
        """The shares of saturated tanh outputs and of dead ReLU units, of the worst layer.

        Both are 0 where the policy is not that of a DQN.
        """
        policy = self.policy
        if not isinstance(policy, DQNPolicy):
            return 0.0, 0.0
        weights = policy.weights
        names = activations_of(policy.activation, len(weights) // 2 - 1)
        saturated, dead, features = [0.0], [0.0], observe(self.states)
        for kernel, bias, name in zip(weights[:-2:2], weights[1:-2:2], names, strict=True):
            features = ACTIVATIONS[name](features @ kernel + bias)
            if name == "tanh":
                saturated.append(float((np.abs(features) > 0.99).mean()))
            elif name == "relu":
                dead.append(float((features.max(axis=0) <= 0).mean()))
        return max(saturated), max(dead)
