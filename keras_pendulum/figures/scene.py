"""A task as the game and films draw it: its picture, its effort and its phase plane."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.environments.task import Task

if TYPE_CHECKING:
    import pygame

Observation = NDArray[np.float32]


class Scene(ABC):
    """The drawings of a task. A further one has a subclass in a module of its own."""

    effort: ClassVar[str]  # the name of what an action exerts, such as the torque
    unit: ClassVar[str]
    largest_effort: ClassVar[float]
    rightward: ClassVar[int]  # the sign of θ to the right, and of the effort that moves it there
    directions: ClassVar[tuple[str, str]]  # of a negative and of a positive effort
    return_digits: ClassVar[int]  # after the decimal point
    # The phase portrait: θ in rad over θ̇ in rad/s, with labels at these places.
    angles: ClassVar[dict[float, str]]
    speeds: ClassVar[Sequence[float]]

    def __init__(self, task: Task) -> None:
        self.task = task

    @abstractmethod
    def effort_of_action(self, action: Any) -> float:
        """Returns the effort of an action of a policy."""

    @abstractmethod
    def state(self, observation: Observation) -> tuple[float, float]:
        """Returns θ in rad, 0 upright, and θ̇ in rad/s, with the signs of the environment."""

    @abstractmethod
    def draw(
        self, observation: Observation, effort: float, size: tuple[int, int]
    ) -> pygame.Surface:
        """Returns a picture of the present state and of the last effort, `size` in pixels."""

    def show_return(self, value: float) -> str:
        """Returns the text of a return."""
        return f"{value:z.{self.return_digits}f}"
