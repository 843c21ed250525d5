"""The measurement of an agent: its values beside the equations and beside the exact values."""

from __future__ import annotations

import copy
import pickle
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from keras_pendulum.diagnosis import signals
from keras_pendulum.diagnosis.backup import Agreement, Backup, Visited, agreement
from keras_pendulum.diagnosis.equation import RIGHT, Equation
from keras_pendulum.diagnosis.equations import agreements
from keras_pendulum.diagnosis.played_agent import PlayedAgent, no_report
from keras_pendulum.diagnosis.signals import Array, Fit
from keras_pendulum.diagnosis.states import visited_states
from keras_pendulum.evaluate.policy import Observations


class LastingAction(NamedTuple):
    """An action that lasts for some steps, as in a program with a frame skip."""

    steps: int
    agreement: Agreement  # of the values with the right equation of such actions


@dataclass(frozen=True)
class Measurement(PlayedAgent):
    """The signals of an agent; those of Q-values are only there where the policy has them."""

    def without_code(self) -> Measurement:
        """Returns a copy whose policy has no part that pickle refuses, such as a local function."""
        copied, policy = copy.copy(self), copy.copy(self.policy)
        vars(copied)["on_episodes"] = no_report
        for name in ("visited", "agreements"):  # they hold functions
            vars(copied).pop(name, None)
        for name, value in vars(policy).items():
            try:
                pickle.dumps(value)
            except Exception:  # which one depends on the value
                setattr(policy, name, None)
        vars(copied)["policy"] = policy
        return copied

    def act(self, observations: Observations) -> Array:
        """Returns the efforts [B] in N·m or N; values that are not finite have efforts too."""
        if self.policy.has_q_values and not self.finite:
            return self.efforts[self.q_values(observations).argmax(axis=1)]
        return super().act(observations)

    def q_values(self, observations: Observations) -> Array:
        """Returns the learned Q-values [B, A] in units of return."""
        with np.errstate(all="ignore"):
            q = np.asarray(self.policy.q_values(observations), np.float64)
        return q / self.reward_scale

    @cached_property
    def visited(self) -> Visited:
        """The network at the states that it visits itself, with random actions."""
        states = visited_states(self.q_values, self.efforts, self.dynamics, self.starts)
        return Visited(
            self.q_values, states, self.efforts, self.dynamics, self.discount, self.reward_scale
        )

    @cached_property
    def backup(self) -> Backup:
        """The values at `visited`, and at all states that can follow, of the declared task."""
        return self.visited.backup()

    @cached_property
    def right_agreement(self) -> Agreement:
        """The agreement of the values with the right equation of the declared task."""
        return agreement(self.backup, self.backup.right)

    @cached_property
    def agreements(self) -> list[tuple[Agreement, Equation]]:
        """The wrong equations, that with the smallest error first."""
        return sorted(agreements(self.visited, self.backup), key=lambda item: item[0].error)

    @cached_property
    def lasting_action(self) -> LastingAction:
        """The number of steps, from 2 to 8, that an action lasts by the values."""
        found = []
        for steps in range(2, 9):
            values = self.visited.backup(steps=steps)
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
        return signals.value_fit(self.learned_q, self.exact_q)

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
    def value_spread(self) -> float:
        """The standard deviation of the exact values at `states`."""
        return float(self.exact_q.mean(axis=1).std())
