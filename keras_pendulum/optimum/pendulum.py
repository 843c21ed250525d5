"""The solution of the pendulum, by dynamic programming."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.environments.pendulum import STEPS_PER_EPISODE, Pendulum, pendulum_starts
from keras_pendulum.optimum.optimal_return import discounted_return, optimal_return
from keras_pendulum.optimum.solution import RANDOM_EPISODES, Solution


class PendulumSolution(Solution):
    """The solution at the gravity of the task. New ones are computed, which takes about 20 s."""

    task: Pendulum

    def best_returns(self, seeds: Iterable[int], steps: int | None = None) -> NDArray[np.float64]:
        """Returns those of `optimal_return`."""
        return optimal_return(self.task.gravity, seeds, steps or STEPS_PER_EPISODE)

    def mean_best_return(self, steps: int) -> float:
        """Returns the mean over the seeds 0 to 999; NaN for longer episodes than Gymnasium's."""
        return math.nan if steps > STEPS_PER_EPISODE else super().mean_best_return(steps)

    def best_return_at(self, angle: float) -> float:
        """Returns the highest return from rest at an angle in degrees, which takes about 20 s."""
        from keras_pendulum.optimum.best_return import best_return

        start = np.array([[math.radians(angle), 0.0]])
        return float(best_return(self.task.gravity, start, STEPS_PER_EPISODE)[0])

    def discounted_returns(
        self, discount: float, seeds: Iterable[int], steps: int | None = None
    ) -> NDArray[np.float64]:
        """Returns those of `discounted_return`."""
        return discounted_return(self.task.gravity, discount, seeds, steps or STEPS_PER_EPISODE)

    def random_return(self, steps: int | None = None) -> float:
        """Returns the mean return of uniformly random torques."""
        from keras_pendulum.optimum.dynamics import TORQUES, simulate_return

        # Simulating all episodes in one array is 20 times as fast as a loop.
        steps = steps or STEPS_PER_EPISODE
        shape = RANDOM_EPISODES, steps
        torques = np.random.RandomState(0).randint(len(TORQUES), size=shape)
        starts = pendulum_starts(range(RANDOM_EPISODES))
        returns = simulate_return(
            lambda step, *_: torques[:, step], steps, self.task.gravity, starts
        )
        return float(returns.mean())
