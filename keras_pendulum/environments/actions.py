"""Action indices, and the actions of the environment that they stand for."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.environments.tasks import TASKS

MAX_TORQUE = 2.0  # N·m, the limit of Pendulum-v1


class Actions(Protocol):
    """The A actions of an environment."""

    @property
    def count(self) -> int:
        """Number of actions A."""

    def to_env_action(self, index: int) -> Any:
        """Returns the action as the environment takes it."""

    def stored_index(self, index: int) -> int:
        """Returns the index that the replay buffer stores for the action `index`."""


class DiscreteActions:
    """The `count` actions of an environment that takes indices, such as CartPole-v1."""

    def __init__(self, count: int) -> None:
        self.count = count

    def to_env_action(self, index: int) -> int:
        """Returns the index."""
        return index

    def stored_index(self, index: int) -> int:
        """Returns the index."""
        return index


class TorqueGrid:
    """`count` torques evenly spaced from -2 to 2 N·m: `linspace(-2, 2, count)`.

    Gymnasium's `DiscretizeAction` cannot replace it: its values are bin centres, ±1.951 N·m at the
    ends for 41 torques.
    """

    def __init__(self, count: int = 41) -> None:
        self.torques: NDArray[np.float64] = np.linspace(-MAX_TORQUE, MAX_TORQUE, count)  # [A] N·m

    @property
    def count(self) -> int:
        """Number of actions A."""
        return len(self.torques)

    def to_env_action(self, index: int) -> NDArray[np.float64]:
        """Returns the torque as the environment takes it: [1], N·m.

        It is float64, as in the original: a float32 torque changes the last digits of the physics.
        """
        return self.torques[index : index + 1]

    def stored_index(self, index: int) -> int:
        """Returns the index."""
        return index

    def nearest_index(self, torque: float) -> int:
        """Returns the index of the torque nearest to `torque` (N·m).

        Raises ValueError for a torque that is not finite or outside ±2 N·m.
        """
        require_torque(torque)
        step = 2 * MAX_TORQUE / (self.count - 1)
        return round((torque + MAX_TORQUE) / step)


class TruncatingTorqueGrid(TorqueGrid):
    """The walkthrough's torques k/10 - 2, with its defect `index-truncation`.

    The replay buffer gets an index that is computed back from the torque. Floating-point rounding
    turns index 2 into 1 and index 4 into 3, so the values of 2 and 4 are never learned.
    """

    def __init__(self) -> None:
        super().__init__(41)
        self.torques = np.arange(41) / 10 - 2  # [A] N·m

    def stored_index(self, index: int) -> int:
        """Returns the truncated index."""
        return truncated_index(float(self.torques[index]))


def truncated_index(torque: float | np.floating[Any]) -> int:
    """Returns the walkthrough's index of a torque (N·m): truncated, not rounded."""
    return int((torque + 2) * 10)


def make_actions(environment: str, torque_count: int, stored_index: str = "exact") -> Actions:
    """Returns the actions of an environment of TASKS.

    Args:
        environment: Gymnasium's name.
        torque_count: how many torques, where the environment takes torques.
        stored_index: exact, or truncated for the defect `index-truncation`.
    """
    action_count = TASKS[environment].action_count
    if action_count is not None:
        return DiscreteActions(action_count)
    return TruncatingTorqueGrid() if stored_index == "truncated" else TorqueGrid(torque_count)


def require_torque(torque: float) -> None:
    """Raises ValueError for a torque (N·m) that is not finite or outside ±2 N·m."""
    if not abs(torque) <= MAX_TORQUE:  # written so that NaN fails too
        raise ValueError(f"torque {torque} N·m; expected a number from -2 to 2")
