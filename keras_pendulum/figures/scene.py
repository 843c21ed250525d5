"""A task as the game and films draw it: its picture, its directions and its phase portrait."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.environments.task import Task
from keras_pendulum.optimum.solutions import known_dynamics

if TYPE_CHECKING:
    import pygame

Observation = NDArray[np.float32]


class Scene(ABC):
    """The drawings of a task with known dynamics. A further one has a subclass in its module."""

    directions: ClassVar[tuple[str, str]]  # of a negative and of a positive effort
    return_digits: ClassVar[int]  # after the decimal point
    angles: ClassVar[dict[float, str]]  # labels of θ in rad, in the phase portrait

    def __init__(self, task: Task) -> None:
        self.task, self.dynamics = task, known_dynamics(task)

    def effort_of_action(self, action: Any) -> float:
        """Returns the effort of an action as the environment takes it."""
        return float(self.dynamics.efforts(np.asarray([action]))[0])

    def state(self, observation: Observation) -> tuple[float, float]:
        """Returns θ in rad, 0 upright, and θ̇ in rad/s, with the signs of the environment."""
        theta, speed = self.dynamics.states_of(observation[np.newaxis])[0, -2:]
        return float(theta), float(speed)

    @abstractmethod
    def draw(
        self, observation: Observation, effort: float, size: tuple[int, int]
    ) -> pygame.Surface:
        """Returns a picture of the present state and of the last effort, `size` in pixels."""

    def show_return(self, value: float) -> str:
        """Returns the text of a return."""
        return f"{value:z.{self.return_digits}f}"
