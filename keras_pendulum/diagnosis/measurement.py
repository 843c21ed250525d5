"""The measurement of an agent: its values beside the equations and beside the exact values."""

from __future__ import annotations

import copy
import pickle
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from keras_pendulum.diagnosis import signals
from keras_pendulum.diagnosis.backup import Agreement, Backup, agreement
from keras_pendulum.diagnosis.equation import RIGHT, Equation
from keras_pendulum.diagnosis.equations import agreements
from keras_pendulum.diagnosis.played_agent import PlayedAgent, no_report
from keras_pendulum.diagnosis.signals import Array, Fit
from keras_pendulum.diagnosis.states import explored_states, observation_changes
from keras_pendulum.dqn.policy import ACTIVATIONS, activations_of
from keras_pendulum.environments.task import Task
from keras_pendulum.evaluate.policy import Observations
from keras_pendulum.evaluate.q_policies import DQNPolicy


class LastingAction(NamedTuple):
    """An action that lasts for some steps, as in a program with a frame skip."""

    steps: int
    agreement: Agreement  # of the values with the right equation of such actions


@dataclass(frozen=True)
class Measurement(PlayedAgent):
    """The signals of an agent; those of Q-values are only there where the policy has them."""

    def __getstate__(self) -> dict[str, Any]:
        """Returns the state for pickle, without what it refuses, such as a local function."""
        policy = copy.copy(self.policy)
        for name, value in vars(policy).items():
            try:
                pickle.dumps(value)
            except Exception:  # which one depends on the value
                setattr(policy, name, None)
        state = {**vars(self), "policy": policy, "on_episodes": no_report}
        state.pop("agreements", None)  # they hold functions
        return state

    def act(self, observations: Observations) -> Array:
        """Returns the efforts [B] in N·m or N; values that are not finite have efforts too."""
        if self.policy.has_q_values and not self.finite:
            return self.greedy_efforts(observations)
        return super().act(observations)

    def greedy_efforts(self, observations: Observations) -> Array:
        """Returns the efforts [B] of the outputs with the highest values."""
        return self.efforts[self.q_values(observations).argmax(axis=1)]

    def q_values(self, observations: Observations) -> Array:
        """Returns the learned Q-values [B, A] in units of return."""
        with np.errstate(all="ignore"):
            q = np.asarray(self.policy.q_values(observations), np.float64)
        return q / self.reward_scale

    @cached_property
    def visited_states(self) -> Array:
        """States [200, S] that the network visits itself, with many random actions."""
        return explored_states(
            self.greedy_efforts, self.efforts, self.dynamics, self.starts, seed=2, count=200
        )

    @cached_property
    def backup(self) -> Backup:
        """The values at `visited_states`, and at all that can follow, of the declared task."""
        return self.changed_backup()

    def changed_backup(
        self,
        task: Task | None = None,
        efforts: Array | None = None,
        observation: str | None = None,
        steps: int = 1,
    ) -> Backup:
        """Returns the values at `visited_states`, and at all states that can follow.

        Args:
            task: in place of the declared one.
            efforts: of the outputs [A], in place of the declared ones.
            observation: one of `observation_changes`, made before the network sees the observation.
            steps: for which each action lasts; then the reward is the sum of theirs.
        """
        dynamics, states = self.dynamics, self.visited_states
        if task is not None:
            dynamics = type(dynamics)(task)
        change = np.eye(len(dynamics.observation_sizes), dtype=np.float32)
        if observation is not None:
            change = observation_changes(dynamics)[observation]
        if observation is not None or steps > 1:  # many are tried: a quarter is enough
            states = states[::4]
        efforts = self.efforts if efforts is None else efforts
        outcomes = dynamics.lasting_outcomes(states, efforts, steps)
        following = outcomes.state.reshape(-1, states.shape[1])
        next_observation: Observations = dynamics.observe(following) @ change
        next_q = self.q_values(next_observation).reshape(*outcomes.reward.shape, -1)
        q = self.q_values(dynamics.observe(states) @ change)
        reward, ended = outcomes.reward, outcomes.terminated
        if ended.any():  # many programs give the last step a penalty, which is no mistake
            reward = np.where(ended, min(float(reward.mean()), float(q[ended].mean())), reward)
        return Backup(q, reward, next_q, self.discount, next_observation, ~ended, self.reward_scale)

    @cached_property
    def right_agreement(self) -> Agreement:
        """The agreement of the values with the right equation of the declared task."""
        return agreement(self.backup, self.backup.right)

    @cached_property
    def agreements(self) -> list[tuple[Agreement, Equation]]:
        """The wrong equations, that with the smallest error first."""
        found = agreements(self, self.backup, self.changed_backup)
        return sorted(found, key=lambda item: item[0].error)

    @cached_property
    def lasting_action(self) -> LastingAction:
        """The number of steps, from 2 to 8, that an action lasts by the values."""
        found = []
        for steps in range(2, 9):
            values = self.changed_backup(steps=steps)
            found.append(LastingAction(steps, agreement(values, values.right)))
        return min(found, key=lambda each: each.agreement.error)

    @cached_property
    def equation_errors(self) -> dict[str, float]:
        """The errors by the formula, that of the right equation first."""
        errors = {RIGHT: self.right_agreement.error}
        for own, equation in self.agreements:
            errors.setdefault(equation.formula, own.error)
        return errors

    @cached_property
    def learned_q(self) -> Array:
        """The learned Q-values [N, A] at `states`."""
        return self.q_values(self.dynamics.observe(self.states))

    @cached_property
    def exact_q(self) -> Array:
        """The exact Q-values [N, A] at `states`."""
        return self.dynamics.exact_q(self.table, self.discount, self.states, self.efforts)

    @cached_property
    def finite(self) -> bool:
        """Whether the learned values are finite."""
        return bool(np.isfinite(self.learned_q).all())

    @cached_property
    def value(self) -> Fit:
        """The fit of the states' values."""
        return signals.line_fit(self.learned_q.mean(axis=1), self.exact_q.mean(axis=1))

    @cached_property
    def advantage(self) -> Fit:
        """The fit of the advantages."""
        return signals.advantage_fit(self.learned_q, self.exact_q)

    @cached_property
    def advantage_size(self) -> float:
        """The spread of the learned advantages as a multiple of that of the exact ones."""
        exact = signals.advantages(self.exact_q).std()
        return float(signals.advantages(self.learned_q).std() / max(exact, 1e-12))

    @cached_property
    def output_efforts(self) -> Array:
        """The effort [A] that each output behaves like."""
        found = signals.output_efforts(self.learned_q, self.exact_q, self.efforts)
        return found / (self.value.slope or 1.0)

    @cached_property
    def outliers(self) -> Array:
        """The robust z-score [A] of each output's mean error."""
        return signals.output_outliers(self.learned_q, self.exact_q)

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
        playing = episodes.playing[:half:5]
        collected = episodes.returns_to_go(self.discount)[:half:5][playing]
        learned = self.q_values(self.dynamics.observe(episodes.states[:half:5][playing]))
        return float(np.median(learned.max(axis=1) - collected)) / self.value_spread

    @cached_property
    def stuck_units(self) -> tuple[float, float]:
        """The shares of saturated tanh outputs and of dead ReLU units, of the worst layer.

        Both are 0 where the policy is not that of a DQN.
        """
        saturated, dead = [0.0], [0.0]
        if isinstance(self.policy, DQNPolicy):
            weights, features = self.policy.weights, self.dynamics.observe(self.states)
            names = activations_of(self.policy.activation, len(weights) // 2 - 1)
            for kernel, bias, name in zip(weights[:-2:2], weights[1:-2:2], names, strict=True):
                features = ACTIVATIONS[name](features @ kernel + bias)
                if name == "tanh":
                    saturated.append(float((np.abs(features) > 0.99).mean()))
                elif name == "relu":
                    dead.append(float((features.max(axis=0) <= 0).mean()))
        return max(saturated), max(dead)

    @cached_property
    def value_spread(self) -> float:
        """The standard deviation of the exact values at `states`."""
        return float(self.exact_q.mean(axis=1).std())
