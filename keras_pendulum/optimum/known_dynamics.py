"""A solution with the dynamics and the exact values of a task, which a diagnosis needs."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.optimum.solution import Array, Solution

Table = NDArray[np.float32]


class Outcomes(NamedTuple):
    """The outcomes of one step from N states, for each of A actions."""

    reward: Array  # [N, A]
    state: Array  # [N, A, S]
    terminated: NDArray[np.bool_]  # [N, A]


class KnownDynamics(Solution):
    """The solution of a task whose dynamics are known.

    A state has the S numbers of `Task.starts`. The effort of an action is a torque in N·m, or a
    force in N.
    """

    effort: ClassVar[str]  # "torque" or "force"
    unit: ClassVar[str]  # of an effort
    largest_effort: ClassVar[float]
    rightward: ClassVar[int]  # the sign of θ to the right, and of the effort that moves it there
    phase_ends: ClassVar[tuple[float, float]]  # largest θ in rad and θ̇ in rad/s of phase planes
    any_effort: ClassVar[bool]  # whether the environment takes those between the outputs' ones, too
    observation_sizes: ClassVar[tuple[float, ...]]  # usual largest absolute values, [D]
    mirror: ClassVar[tuple[int, ...]]  # signs [D] of an observation whose effort is reversed
    other_units: ClassVar[dict[str, tuple[float, ...]]]  # factors [D], by what the observation is
    least_random: ClassVar[float]  # share of random actions at which a diagnosis looks

    @abstractmethod
    def observe(self, states: Array) -> NDArray[np.float32]:
        """Returns the observations [N, D] of states [N, S]."""

    @abstractmethod
    def states_of(self, observations: NDArray[Any]) -> Array:
        """Returns the states [N, S] of observations [N, D]."""

    @abstractmethod
    def efforts(self, actions: NDArray[Any]) -> Array:
        """Returns the efforts [N] of actions as the environment takes them."""

    @abstractmethod
    def outcomes(self, states: Array, efforts: Array) -> Outcomes:
        """Returns the outcomes of one step, of states [N, S] and efforts [A] or [N, A]."""

    def lasting_outcomes(self, states: Array, efforts: Array, steps: int) -> Outcomes:
        """Returns the outcomes of efforts [A] that act for some steps; the rewards are added."""
        reward, state, ended = self.outcomes(states, efforts)
        efforts = np.tile(efforts, len(states))[:, None]
        for _ in range(steps - 1):
            again = self.outcomes(state.reshape(reward.size, -1), efforts)
            reward = reward + np.where(ended, 0, again.reward.reshape(reward.shape))
            state = np.where(ended[..., None], state, again.state.reshape(state.shape))
            ended = ended | again.terminated.reshape(ended.shape)
        return Outcomes(reward, state, ended)

    def are_over(self, states: Array) -> NDArray[np.bool_]:
        """Returns whether states [N, S] are those after the end of an episode."""
        return np.zeros(len(states), bool)

    @abstractmethod
    def table(self, discount: float) -> Table:
        """Returns the exact V for a discount γ, for the next two methods.

        One that is computed for the first time takes about 10 s. Raises ConfigError for a discount
        that is not from 0 to 1.
        """

    @abstractmethod
    def exact_q(self, table: Table, discount: float, states: Array, efforts: Array) -> Array:
        """Returns the Q-values [N, A] of the optimum for a discount γ, and V from its `table`."""

    @abstractmethod
    def greedy_efforts(self, table: Table, discount: float, states: Array) -> Array:
        """Returns the efforts [N] of the policy that is optimal for a discount γ."""

    def survives(self, states: Array) -> NDArray[np.bool_]:
        """Returns whether the optimum never terminates from states [N, S]."""
        return np.ones(len(states), bool)
