"""The measurement of an agent: its signals at the states of its task, and its episodes."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np

from keras_pendulum.config.config import Config
from keras_pendulum.diagnosis import signals
from keras_pendulum.diagnosis.backup import Agreement, Backup, Visited, agreement
from keras_pendulum.diagnosis.equation import RIGHT, Equation
from keras_pendulum.diagnosis.equations import agreements
from keras_pendulum.diagnosis.motion import Motion
from keras_pendulum.diagnosis.motions import motion_kind
from keras_pendulum.diagnosis.run_record import RunRecord
from keras_pendulum.diagnosis.signals import Array, Fit
from keras_pendulum.diagnosis.states import (
    Act,
    Episodes,
    simulate,
    training_states,
    visited_states,
)
from keras_pendulum.environments.task import Task
from keras_pendulum.errors import ConfigError
from keras_pendulum.evaluate.policy import Observations, Policy
from keras_pendulum.optimum.known_dynamics import KnownDynamics, Table
from keras_pendulum.optimum.solutions import solution

STARTS = 60  # seeds 0, 1, …


def _nothing(count: int) -> None:
    pass


@dataclass(frozen=True)
class Measurement:
    """The signals of a policy on its declared task, each computed when it is first used.

    Those of Q-values are only there where the policy has them.
    """

    policy: Policy
    task: Task  # whose dynamics are known
    discount: float  # γ
    reward_scale: float = 1.0  # declared factor on the rewards
    record: RunRecord | None = None  # of the run that trained the policy
    start_count: int = STARTS
    on_episodes: Callable[[int], None] = _nothing  # called when so many are played

    @cached_property
    def dynamics(self) -> KnownDynamics:
        """The dynamics of the task, and its exact values."""
        found = solution(self.task)
        assert isinstance(found, KnownDynamics)
        return found

    @property
    def efforts(self) -> Array:
        """The efforts [A] of the outputs in N·m or N; without outputs, those of the record."""
        if self.policy.actions is not None:
            return self.dynamics.all_efforts(self.policy.actions)
        assert self.record is not None and self.record.own_efforts is not None
        return self.record.own_efforts

    @cached_property
    def motion(self) -> Motion:
        """The motion of the record's transitions."""
        assert self.record is not None
        kind, stored = motion_kind(self.dynamics), self.record.stored_efforts(self.efforts)
        return kind(self.dynamics, self.record.replay, stored, self.efforts)

    def without_code(self) -> Measurement:
        """Returns a copy whose policy has no part that pickle refuses, such as a local function."""
        copied, policy = copy.copy(self), copy.copy(self.policy)
        vars(copied)["on_episodes"] = _nothing
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
        """Returns the efforts [B] in N·m or N."""
        if self.policy.has_q_values and not self.finite:
            return self.efforts[self.q_values(observations).argmax(axis=1)]
        return self.dynamics.efforts(self.policy.act(observations))

    def play(self, act: Act) -> Episodes:
        """Returns the episodes of a policy from the starts.

        A policy that may have a state plays one after the other, as in `evaluate_policy`.
        """
        alone = self.policy.one_by_one and not self.policy.has_q_values
        parts = np.array_split(self.starts, len(self.starts) if alone else 1)
        played = []
        for starts in parts:
            self.policy.reset()
            played.append(simulate(act, self.dynamics, starts))
            self.on_episodes(len(starts))
        return Episodes(
            np.concatenate([each.states for each in played], axis=1),
            np.concatenate([each.rewards for each in played], axis=1),
            np.concatenate([each.playing for each in played], axis=1),
        )

    def q_values(self, observations: Observations) -> Array:
        """Returns the learned Q-values [B, A] in units of return."""
        with np.errstate(all="ignore"):
            q = np.asarray(self.policy.q_values(observations), np.float64)
        return q / self.reward_scale

    @property
    def settings(self) -> Mapping[str, Any]:
        """The settings of the run, as far as they are known."""
        config = None if self.record is None else self.record.config
        return self.policy.info.settings if config is None else asdict(config)

    @property
    def updates(self) -> int | None:
        """The number of updates of the run, as its record or its settings have it, else None."""
        if self.record is not None and self.record.updates is not None:
            return self.record.updates
        try:
            return Config(**self.settings).total_updates if self.settings else None
        except (TypeError, ConfigError):  # settings of another version
            return None

    @cached_property
    def starts(self) -> Array:
        """The starts [B, S] of the episodes."""
        return self.dynamics.starts(range(self.start_count))

    @cached_property
    def episodes(self) -> Episodes:
        """The agent's episodes."""
        return self.play(self.act)

    @cached_property
    def first_efforts(self) -> Array:
        """The efforts [B] at the starts."""
        return self.act(self.dynamics.observe(self.starts))

    @cached_property
    def optimum(self) -> float:
        """The mean optimal return of the starts."""
        return float(self.dynamics.best_returns(range(self.start_count)).mean())

    @cached_property
    def discount_cost(self) -> float:
        """The regret of the exact policy for the declared discount."""
        return self.dynamics.discount_cost(self.discount, range(self.start_count)) or 0.0

    @cached_property
    def regret(self) -> float:
        """The mean optimal return minus the agent's."""
        return self.optimum - float(self.episodes.returns.mean())

    @property
    def avoidable_regret(self) -> float:
        """The regret that is not the discount's."""
        return self.regret - self.discount_cost

    @cached_property
    def regret_tolerance(self) -> float:
        """The regret that needs no finding: 1 % of the way from random actions to the optimum.

        What the discount costs comes on top, because no training can win it back.
        """
        way = self.optimum - self.dynamics.random_return()
        return 0.01 * max(way, 1.0) + self.discount_cost

    @cached_property
    def table(self) -> Table:
        """V of the declared task."""
        return self.dynamics.table(self.discount)

    @cached_property
    def states(self) -> Array:
        """States [N, S] that a run of this task meets."""
        return training_states(self.table, self.dynamics, self.discount, self.starts)

    @cached_property
    def visited(self) -> Visited:
        """The network at the states that it visits itself, with random actions."""
        states = visited_states(self.q_values, self.efforts, self.dynamics, self.starts)
        return Visited(self.q_values, states, self.efforts, self.dynamics, self.discount)

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
    def equation_errors(self) -> dict[str, float]:
        """The errors by the formula, that of the right equation first."""
        errors = {RIGHT: self.right_agreement.error}
        for own, equation in self.agreements:
            errors.setdefault(equation.formula, own.error)
        return errors

    @property
    def obeys_right_equation(self) -> bool:
        """Whether the values are near the fixed point of the right equation."""
        return self.right_agreement.error < 0.1 and self.right_agreement.correlation > 0.5

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
