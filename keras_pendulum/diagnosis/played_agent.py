"""A policy on its declared task: its efforts, its episodes, and what they cost."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np

from keras_pendulum.config.config import Config
from keras_pendulum.diagnosis.motion import Motion
from keras_pendulum.diagnosis.run_record import RunRecord, motion_kind
from keras_pendulum.diagnosis.signals import Array
from keras_pendulum.diagnosis.states import Act, Episodes, explored_states, simulate
from keras_pendulum.environments.task import Task
from keras_pendulum.errors import ConfigError
from keras_pendulum.evaluate.policy import Observations, Policy
from keras_pendulum.optimum.known_dynamics import KnownDynamics, Table
from keras_pendulum.optimum.solutions import known_dynamics

STARTS = 60  # seeds 0, 1, …


def no_report(count: int) -> None:
    """Reports no episodes."""


@dataclass(frozen=True)
class PlayedAgent:
    """A policy on its declared task; each figure is computed when it is first used."""

    policy: Policy
    task: Task  # whose dynamics are known
    discount: float  # γ
    reward_scale: float = 1.0  # declared factor on the rewards
    record: RunRecord | None = None  # of the run that trained the policy
    start_count: int = STARTS
    on_episodes: Callable[[int], None] = no_report  # called when so many are played

    @cached_property
    def dynamics(self) -> KnownDynamics:
        """The dynamics of the task, and its exact values."""
        return known_dynamics(self.task)

    @property
    def efforts(self) -> Array:
        """The efforts [A] of the outputs in N·m or N; without outputs, those of the record."""
        if self.policy.actions is not None:
            return self.dynamics.efforts(self.policy.actions.values)
        assert self.record is not None and self.record.own_efforts is not None
        return self.record.own_efforts

    @cached_property
    def motion(self) -> Motion:
        """The motion of the record's transitions."""
        assert self.record is not None
        kind, stored = motion_kind(self.dynamics), self.record.stored_efforts(self.efforts)
        return kind(self.dynamics, self.record.replay, stored, self.efforts)

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
        columns = zip(*played, strict=True)
        return Episodes(*(np.concatenate(column, axis=1) for column in columns))

    def act(self, observations: Observations) -> Array:
        """Returns the efforts [B] in N·m or N."""
        return self.dynamics.efforts(self.policy.act(observations))

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
        return self.task.starts(range(self.start_count))

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
        """States [1500, S] that a run meets: the exact policy with many random actions."""
        exact = self.dynamics

        def greedy(observations: Observations) -> Array:
            return exact.greedy_efforts(self.table, self.discount, exact.states_of(observations))

        efforts = exact.efforts(self.task.actions().values)
        return explored_states(greedy, efforts, exact, self.starts, seed=1, count=1500)
