"""The solution of the pendulum, by dynamic programming.

The package contains the returns of seeds 0 to 9999 for g = 1 and for g = 10, for whole episodes and
for the training episodes of `reference` and `swingup`. It contains those of the policies that are
optimal for the discounts of these presets, for seeds 0 to 999.
`python -m benchmarks.learning.shipped_optima` writes them. All others are computed at their first
use, by `best_return`, and stored in the user's cache folder.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.config.fields import SEED
from keras_pendulum.environments.pendulum import MAX_SPEED, STEPS_PER_EPISODE, Pendulum
from keras_pendulum.environments.torque import MAX_TORQUE
from keras_pendulum.optimum.best_return import best_return, compute_returns
from keras_pendulum.optimum.discounted import discounted_value
from keras_pendulum.optimum.dynamics import TORQUES, simulate_return, step_all_torques
from keras_pendulum.optimum.known_dynamics import KnownDynamics, Outcomes, Table
from keras_pendulum.optimum.solution import RANDOM_EPISODES, USUAL_SEEDS, Array
from keras_pendulum.optimum.stored_results import (
    Problem,
    cache_file,
    read_returns,
    shipped_file,
    write_to_cache,
)
from keras_pendulum.optimum.value_iteration import value_at


class PendulumSolution(KnownDynamics):
    """The solution at the gravity of the task.

    A state is θ in rad and θ̇ in rad/s, S = 2.
    """

    task: Pendulum
    effort: ClassVar[str] = "torque"
    unit: ClassVar[str] = "N·m"
    largest_effort: ClassVar[float] = MAX_TORQUE
    rightward: ClassVar[int] = -1
    phase_ends: ClassVar[tuple[float, float]] = (math.pi, MAX_SPEED)
    any_effort: ClassVar[bool] = True
    observation_sizes: ClassVar[tuple[float, ...]] = (1.0, 1.0, MAX_SPEED)
    mirror: ClassVar[tuple[int, ...]] = (1, -1, -1)
    other_units: ClassVar[dict[str, tuple[float, ...]]] = {
        "cos θ, sin θ, θ̇·π/180": (1, 1, math.pi / 180),
        "cos θ, sin θ, θ̇·180/π": (1, 1, 180 / math.pi),
        "cos θ, sin θ, θ̇/8": (1, 1, 1 / MAX_SPEED),
    }
    least_random: ClassVar[float] = 0.1

    def observe(self, states: Array) -> NDArray[np.float32]:
        """Returns the observations [N, 3] of states [N, 2]."""
        theta, speed = states.T
        observations = np.empty((len(states), 3), np.float32)  # `stack` takes most of a single step
        observations[:, 0], observations[:, 1] = np.cos(theta), np.sin(theta)
        observations[:, 2] = speed
        return observations

    def states_of(self, observations: NDArray[Any]) -> Array:
        """Returns the states [N, 2] of observations [N, 3]."""
        cosine, sine, speed = observations.astype(np.float64).T
        return np.stack([np.arctan2(sine, cosine), speed], axis=1)

    def efforts(self, actions: NDArray[Any]) -> Array:
        """Returns the torques [N] in N·m of actions [N, 1]."""
        return np.asarray(actions[:, 0], np.float64)

    def outcomes(self, states: Array, efforts: Array) -> Outcomes:
        """Returns the outcomes of one step, for torques [A] or [N, A] in N·m."""
        reward, theta, speed = step_all_torques(
            self.task.gravity, states[:, 0], states[:, 1], efforts
        )
        following = np.empty((*theta.shape, 2))
        following[..., 0], following[..., 1] = theta, speed
        return Outcomes(reward, following, np.zeros(reward.shape, bool))

    def table(self, discount: float) -> Table:
        """Returns that of `discounted_value`."""
        return discounted_value(self.task.gravity, discount)

    def exact_q(self, table: Table, discount: float, states: Array, efforts: Array) -> Array:
        """Returns the Q-values [N, A]: reward + γ V(next state).

        The torques of all later steps are those of V: the best of 41.
        """
        theta, speed = states.T
        reward, theta, speed = step_all_torques(self.task.gravity, theta, speed, efforts)
        return reward + discount * value_at(table, theta, speed)

    def greedy_efforts(self, table: Table, discount: float, states: Array) -> Array:
        """Returns the torques [N] in N·m, of the 41."""
        q = self.exact_q(table, discount, states, TORQUES)
        return np.asarray(TORQUES[q.argmax(axis=1)])

    def best_returns(self, seeds: Iterable[int], steps: int | None = None) -> NDArray[np.float64]:
        """Returns those for γ = 1."""
        return self.discounted_returns(1.0, seeds, steps)

    def mean_best_return(self, steps: int) -> float:
        """Returns the mean over the seeds 0 to 999; NaN for longer episodes than Gymnasium's."""
        return math.nan if steps > STEPS_PER_EPISODE else super().mean_best_return(steps)

    def best_return_at(self, angle: float) -> float:
        """Returns the highest return from rest at an angle in degrees, which takes about 20 s."""
        start = np.array([[math.radians(angle), 0.0]])
        return float(best_return(self.task.gravity, start, STEPS_PER_EPISODE)[0])

    def discounted_returns(
        self, discount: float, seeds: Iterable[int], steps: int | None = None
    ) -> NDArray[np.float64]:
        """Returns the undiscounted returns of the policy that is optimal for a discount γ, 0 to 1.

        Those of γ = 1 are the highest possible ones. Stored returns are read in milliseconds.
        Others take about 20 s. They are then stored in the user's cache folder, if it can be
        written, together with those of seeds 0 to 999.

        Args:
            discount: γ.
            seeds: reset seeds, each 0 to 2³² - 1.
            steps: steps per episode, 1 to 200; None takes 200.

        Returns [number of seeds], in the order of `seeds`; each is attainable. Raises ConfigError
        for a number out of range.
        """
        steps = STEPS_PER_EPISODE if steps is None else steps
        problem = Problem.valid(self.task.gravity, steps, discount)
        seeds = [SEED.validate("seed", seed) for seed in seeds]
        cache = cache_file(problem.file_name)
        returns = read_returns(shipped_file(problem.file_name), problem)
        if not returns.keys() >= set(seeds):
            returns = read_returns(cache, problem) | returns
        if not returns.keys() >= set(seeds):
            missing = sorted({*seeds, *USUAL_SEEDS} - returns.keys())
            computed = compute_returns(problem, self.task.starts(missing))
            returns |= zip(missing, computed.tolist(), strict=True)
            arrays = {"seeds": np.array(list(returns)), "returns": np.array(list(returns.values()))}
            write_to_cache(cache, problem._asdict() | arrays)
        return np.array([returns[seed] for seed in seeds], np.float64)

    def random_return(self, steps: int | None = None) -> float:
        """Returns the mean return of uniformly random torques."""
        # Simulating all episodes in one array is 20 times as fast as a loop.
        steps = steps or STEPS_PER_EPISODE
        shape = RANDOM_EPISODES, steps
        torques = np.random.RandomState(0).randint(len(TORQUES), size=shape)
        starts = self.task.starts(range(RANDOM_EPISODES))
        returns = simulate_return(
            lambda step, *_: torques[:, step], steps, self.task.gravity, starts
        )
        return float(returns.mean())
