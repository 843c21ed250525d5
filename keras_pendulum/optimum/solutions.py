"""The solutions of the tasks, by the names of their environments."""

from __future__ import annotations

from typing import Any

from keras_pendulum.environments.task import Task
from keras_pendulum.optimum.cartpole import CartPoleSolution
from keras_pendulum.optimum.pendulum import PendulumSolution
from keras_pendulum.optimum.solution import Solution

SOLUTIONS: dict[str, Any] = {  # classes that take the task
    "Pendulum-v1": PendulumSolution,
    "CartPole-v1": CartPoleSolution,
}


def solution(task: Task) -> Solution:
    """Returns the solution of a task."""
    found: Solution = SOLUTIONS[task.environment](task)
    return found
