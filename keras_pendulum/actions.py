"""What an action's index means to an environment."""

from __future__ import annotations

from typing import Any, Protocol

from keras_pendulum.environment import TASKS
from keras_pendulum.torque import TorqueGrid


class Actions(Protocol):
    """Actions by their index; TorqueGrid is one."""

    @property
    def count(self) -> int:
        """Number of actions A."""

    def control(self, index: int) -> Any:
        """The action as the environment takes it."""

    def remembered_index(self, index: int) -> int:
        """What the replay buffer keeps for the action."""


class Indices:
    """The environment's own `count` actions, which it takes by their index."""

    def __init__(self, count: int) -> None:
        self.count = count

    def control(self, index: int) -> int:
        """The index itself."""
        return index

    def remembered_index(self, index: int) -> int:
        """The index itself."""
        return index


def make_actions(environment: str, count: int | None) -> Actions:
    """The actions of an environment of TASKS; `count` is how many torques, where it has torques."""
    own = TASKS[environment].action_count
    if own is not None:
        return Indices(own)
    return TorqueGrid() if count is None else TorqueGrid(count)
