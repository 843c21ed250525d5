"""The played tasks, by the names of their environments."""

from __future__ import annotations

from typing import Any

from keras_pendulum.environments.task import Task
from keras_pendulum.play.cartpole import PlayedCartPole
from keras_pendulum.play.pendulum import PlayedPendulum
from keras_pendulum.play.played_task import PlayedTask

PLAYED_TASKS: dict[str, Any] = {  # classes that take the task
    "Pendulum-v1": PlayedPendulum,
    "CartPole-v1": PlayedCartPole,
}


def played_task(task: Task) -> PlayedTask:
    """Returns a task as the game plays it."""
    played: PlayedTask = PLAYED_TASKS[task.environment](task)
    return played
