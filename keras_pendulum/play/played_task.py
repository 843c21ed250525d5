"""A task as the game plays it: what the keys do, and what the window shows."""

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


class PlayedTask(ABC):
    """A task in the game. A further one has a subclass in a module of its own."""

    effort: ClassVar[str]  # what a key sets, such as the torque
    unit: ClassVar[str]
    largest_effort: ClassVar[float]
    rightward: ClassVar[int]  # the sign of θ to the right, and of the effort that moves it there
    directions: ClassVar[tuple[str, str]]  # of a negative and of a positive effort
    keys: ClassVar[str]
    return_digits: ClassVar[int]  # after the decimal point
    # The phase portrait: θ in rad over θ̇ in rad/s, with labels at these places.
    angles: ClassVar[dict[float, str]]
    speeds: ClassVar[Sequence[float]]

    def __init__(self, task: Task) -> None:
        self.task = task

    @property
    def setting(self) -> str:
        """The line of the window on the physics or on the clock."""
        return ""

    @abstractmethod
    def effort_of(self, direction: int, step: int) -> float:
        """Returns the effort in `unit` of a key, in a step of the episode.

        Args:
            direction: -1, 0 or 1.
            step: 0 is the first one.
        """

    @abstractmethod
    def action(self, effort: float) -> Any:
        """Returns the action of the environment. Raises ValueError for an impossible effort."""

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
