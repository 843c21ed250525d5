"""A task as the game plays it: what the keys do."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, ClassVar

import numpy as np

from keras_pendulum.environments.pendulum import Pendulum
from keras_pendulum.environments.task import Task
from keras_pendulum.environments.torque import MAX_TORQUE, require_torque
from keras_pendulum.figures.scenes import scene
from keras_pendulum.optimum.cartpole_dynamics import FORCE


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
    def effort_of(self, direction: int, step: int) -> float:
        """Returns the effort of a key, in a step of the episode.

        Args:
            direction: -1, 0 or 1.
            step: 0 is the first one.
        """

    @abstractmethod
    def action(self, effort: float) -> Any:
        """Returns the action of the environment. Raises ValueError for an impossible effort."""


class PlayedPendulum(PlayedTask):
    """A key sets the torque to -2, 0 or 2 N·m."""

    task: Pendulum
    keys: ClassVar[str] = "l or Left: +2 N·m      k or Down: 0      j or Right: -2 N·m"

    @property
    def setting(self) -> str:
        """The gravity."""
        return f"g = {self.task.gravity:g} m/s²"

    def effort_of(self, direction: int, step: int) -> float:
        """Returns the torque in N·m."""
        return MAX_TORQUE * direction

    def action(self, effort: float) -> Any:
        """Returns the torque as an array [1]. Raises ValueError for one outside of ±2 N·m."""
        # The environment would clip a larger torque, and its state would stay NaN after a NaN.
        require_torque(effort)
        return np.array([effort])


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

    def effort_of(self, direction: int, step: int) -> float:
        """Returns the force in N, to the right."""
        return FORCE * (direction or (1 if step % 2 else -1))

    def action(self, effort: float) -> int:
        """Returns 0 or 1. Raises ValueError for another force than ±10 N."""
        if abs(effort) != FORCE:
            raise ValueError(f"force is {effort!r}; expected -{FORCE:g} or {FORCE:g} (N)")
        return int(effort > 0)


PLAYED_TASKS: dict[str, Any] = {  # by environment; classes that take the task
    "Pendulum-v1": PlayedPendulum,
    "CartPole-v1": PlayedCartPole,
}


def played_task(task: Task) -> PlayedTask:
    """Returns a task as the game plays it."""
    played: PlayedTask = PLAYED_TASKS[task.environment](task)
    return played
