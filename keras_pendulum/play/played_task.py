"""A task as the game plays it: what the keys do."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, ClassVar

import numpy as np

from keras_pendulum.environments.pendulum import Pendulum
from keras_pendulum.environments.task import Task
from keras_pendulum.environments.torque import MAX_TORQUE
from keras_pendulum.figures.scenes import scene


class PlayedTask(ABC):
    """A task in the game, with its drawings."""

    keys: ClassVar[str]

    def __init__(self, task: Task) -> None:
        self.task, self.scene = task, scene(task)

    @property
    @abstractmethod
    def setting(self) -> str:
        """The line of the window on the physics or on the clock."""

    @abstractmethod
    def action(self, direction: int, step: int) -> Any:
        """Returns the action of a key, as the environment takes it.

        Args:
            direction: of the effort: -1, 0 or 1.
            step: of the episode; 0 is the first one.
        """


class PlayedPendulum(PlayedTask):
    """A key sets the torque to -2, 0 or 2 N·m."""

    task: Pendulum
    keys: ClassVar[str] = "l or Left: +2 N·m      k or Down: 0      j or Right: -2 N·m"

    @property
    def setting(self) -> str:
        """The gravity."""
        return f"g = {self.task.gravity:g} m/s²"

    def action(self, direction: int, step: int) -> Any:
        """Returns the torque [1] in N·m."""
        return np.array([MAX_TORQUE * direction])


class PlayedCartPole(PlayedTask):
    """A key sets the direction of the push.

    CartPole has no step without a push, so the pushes alternate without a key.
    """

    keys: ClassVar[str] = (
        "j or Left: push left      k or Down: alternate      l or Right: push right"
    )

    @property
    def setting(self) -> str:
        """The speed of the game: a hand is too slow for the real one."""
        return "slow motion, 20 steps a second"

    def action(self, direction: int, step: int) -> int:
        """Returns 0 or 1."""
        return int(direction > 0) if direction else step % 2


PLAYED_TASKS: dict[str, Any] = {  # by environment; classes that take the task
    "Pendulum-v1": PlayedPendulum,
    "CartPole-v1": PlayedCartPole,
}


def played_task(task: Task) -> PlayedTask:
    """Returns a task as the game plays it."""
    played: PlayedTask = PLAYED_TASKS[task.environment](task)
    return played
