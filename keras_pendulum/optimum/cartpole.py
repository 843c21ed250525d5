"""The solution of CartPole, by dynamic programming: every start can be balanced to the end."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.config.fields import SEED, Integer
from keras_pendulum.optimum.cartpole_dynamics import (
    FORCE,
    FORCES,
    LARGEST_ANGLE,
    LARGEST_POSITION,
    has_fallen,
    step_forces,
)
from keras_pendulum.optimum.cartpole_values import (
    cartpole_q,
    cartpole_value,
    highest_value,
    value_at,
    whole_table,
)
from keras_pendulum.optimum.known_dynamics import KnownDynamics, Outcomes, Table
from keras_pendulum.optimum.solution import Array


class CartPoleSolution(KnownDynamics):
    """The best return is 1 for each step of the episode.

    A state is the observation as float64: x, ẋ, θ and θ̇.
    """

    effort: ClassVar[str] = "force"
    unit: ClassVar[str] = "N"
    largest_effort: ClassVar[float] = FORCE
    rightward: ClassVar[int] = 1
    phase_ends: ClassVar[tuple[float, float]] = (LARGEST_ANGLE, 3.0)
    any_effort: ClassVar[bool] = False
    observation_sizes: ClassVar[tuple[float, ...]] = (LARGEST_POSITION, 3.0, LARGEST_ANGLE, 3.0)
    mirror: ClassVar[tuple[int, ...]] = (-1, -1, -1, -1)
    other_units: ClassVar[dict[str, tuple[float, ...]]] = {
        "x, ẋ, θ·180/π, θ̇·180/π": (1, 1, 180 / math.pi, 180 / math.pi),
        "x, ẋ, θ·180/π, θ̇": (1, 1, 180 / math.pi, 1),
        "x/2.4, ẋ/3, θ/0.21, θ̇/3": (1 / LARGEST_POSITION, 1 / 3, 1 / LARGEST_ANGLE, 1 / 3),
    }
    least_random: ClassVar[float] = 0.3  # a good policy stays where all values are the same

    def observe(self, states: Array) -> NDArray[np.float32]:
        """Returns the states, rounded to float32."""
        return states.astype(np.float32)

    def states_of(self, observations: NDArray[Any]) -> Array:
        """Returns the observations as float64."""
        return observations.astype(np.float64)

    def efforts(self, actions: NDArray[Any]) -> Array:
        """Returns the forces [N] in newton of the actions 0 and 1."""
        return np.asarray(FORCES[actions])

    def outcomes(self, states: Array, efforts: Array) -> Outcomes:
        """Returns the outcomes of one step, for forces [A] or [N, A] in newton."""
        return step_forces(states, efforts)

    def are_over(self, states: Array) -> NDArray[np.bool_]:
        """Returns whether states [N, 4] are beyond ±2.4 m or ±12°."""
        return has_fallen(states)

    def table(self, discount: float) -> Table:
        """Returns that of `cartpole_value`."""
        return whole_table(cartpole_value(discount))

    def exact_q(self, table: Table, discount: float, states: Array, efforts: Array) -> Array:
        """Returns the Q-values [N, A]."""
        return cartpole_q(table, discount, states, efforts)

    def greedy_efforts(self, table: Table, discount: float, states: Array) -> Array:
        """Returns the forces [N] in newton."""
        # V is interpolated without a look ahead. Each discount above 0 gives the same order.
        q = cartpole_q(table, 1.0, states, lookahead=0)
        return np.asarray(FORCES[q.argmax(axis=1)])

    def best_returns(self, seeds: Iterable[int], steps: int | None = None) -> Array:
        """Returns the number of steps for each seed. Raises ConfigError for one out of range."""
        seeds = [SEED.validate("seed", seed) for seed in seeds]
        steps = self.task.steps_per_episode if steps is None else steps
        return np.full(len(seeds), float(Integer(1, 10**9).validate("steps", steps)))

    def survives(self, states: Array) -> NDArray[np.bool_]:
        """Returns whether the optimum balances the pole from states [N, 4].

        Its values for γ = 0.99 are below 90 % of the highest one where it does not.
        """
        values = value_at(self.table(0.99), 0.99, states)
        return np.asarray(values > 0.9 * highest_value(0.99))

    def discounted_returns(
        self, discount: float, seeds: Iterable[int], steps: int | None = None
    ) -> Array:
        """Returns the steps until the policy falls that is optimal for a discount γ."""
        table, states = self.table(discount), self.task.starts(seeds)
        returns, standing = np.zeros(len(states)), np.ones(len(states), bool)
        for _ in range(steps or self.task.steps_per_episode):
            forces = self.greedy_efforts(table, discount, states)
            returns += standing
            states = step_forces(states, forces[:, None]).state[:, 0]
            standing &= ~has_fallen(states)
        return returns
