"""The exact solution of a task: its best returns, and the regret that its discount costs."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable
from functools import cache

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.environments.task import Task

USUAL_SEEDS = range(1000)  # computed together, because most of the time goes into V
RANDOM_EPISODES = 100

Array = NDArray[np.float64]


class Solution(ABC):
    """The solution of a task. A further task has a subclass in a module of its own.

    Where a quantity is not known, the methods return NaN or None.
    """

    def __init__(self, task: Task) -> None:
        self.task = task

    @abstractmethod
    def best_returns(self, seeds: Iterable[int], steps: int | None = None) -> NDArray[np.float64]:
        """Returns the highest return of an episode from each start `reset(seed=…)`: [seeds].

        None stands for Gymnasium's limit of steps, here and below.
        """

    def mean_best_return(self, steps: int) -> float:
        """Returns the mean over the seeds 0 to 999; NaN for longer episodes than Gymnasium's."""
        return float(self.best_returns(USUAL_SEEDS, steps).mean())

    def best_return_at(self, angle: float) -> float:
        """Returns the highest return of an episode from rest at an angle in degrees."""
        return math.nan

    def discounted_returns(
        self, discount: float, seeds: Iterable[int], steps: int | None = None
    ) -> NDArray[np.float64] | None:
        """Returns what the optimal policy for a discount γ collects; None where it is unknown.

        These are undiscounted returns, [number of seeds].
        """
        return None

    def discount_cost(self, discount: float | None, seeds: range) -> float | None:
        """Returns the regret of the optimal policy for a discount; None where it is unknown."""
        returns = None if discount is None else self.discounted_returns(discount, seeds)
        if returns is None:
            return None
        return max(0.0, float((self.best_returns(seeds) - returns).mean()))

    def random_return(self, steps: int | None = None) -> float:
        """Returns the mean return of uniformly random actions from the starts of seeds 0 to 99."""
        return _random_return(self.task, steps)


@cache
def _random_return(task: Task, steps: int | None) -> float:
    random, actions = np.random.RandomState(0), task.actions()
    env = task.make_env(steps=steps)
    total = 0.0
    for seed in range(RANDOM_EPISODES):
        env.reset(seed=seed)
        done = False
        while not done:
            action = actions.to_env_action(random.randint(actions.count))
            _, reward, terminated, truncated, _ = env.step(action)
            total += float(reward)
            done = terminated or truncated
    return total / RANDOM_EPISODES
