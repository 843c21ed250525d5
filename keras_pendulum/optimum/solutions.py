"""The solutions of the tasks, by the names of their environments."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.environments.task import Task
from keras_pendulum.environments.tasks import declared_task
from keras_pendulum.optimum.cartpole import CartPoleSolution
from keras_pendulum.optimum.known_dynamics import KnownDynamics
from keras_pendulum.optimum.pendulum import PendulumSolution
from keras_pendulum.optimum.solution import Solution

SOLUTIONS: dict[str, Any] = {  # classes that take the task
    "Pendulum-v1": PendulumSolution,
    "CartPole-v1": CartPoleSolution,
}


def solution(task: Task) -> Solution:
    """Returns the solution of a task."""
    return SOLUTIONS[task.environment](task)


def known_dynamics(task: Task) -> KnownDynamics:
    """Returns the solution of a task whose dynamics are known."""
    found = solution(task)
    assert isinstance(found, KnownDynamics)
    return found


def optimal_return(
    gravity: float | None = None,
    seeds: Iterable[int] = range(100),
    steps: int | None = None,
    environment: str = "Pendulum-v1",
) -> NDArray[np.float64]:
    """Returns the highest undiscounted return of an episode from each start `reset(seed=…)`.

    Stored returns of the pendulum are read in milliseconds. Others take about 20 s. They are then
    stored in the user's cache folder, if it can be written, together with those of seeds 0 to 999.

    Args:
        gravity: g in m/s², 0 to 100, of the pendulum; None takes 1.
        seeds: reset seeds, each 0 to 2³² - 1.
        steps: steps per episode, of the pendulum 1 to 200; None takes 200, or 500 for CartPole.
        environment: `Pendulum-v1` or `CartPole-v1`.

    Returns:
        [number of seeds], in the order of `seeds`; each return is attainable.

    Raises:
        ConfigError: (a ValueError) for a gravity, a seed, steps or an environment out of range.

    >>> kp.optimal_return(gravity=1.0, seeds=range(3)).shape
    (3,)
    >>> kp.optimal_return(seeds=[7], environment="CartPole-v1")
    array([500.])
    """
    return solution(declared_task(environment).with_gravity(gravity)).best_returns(seeds, steps)
