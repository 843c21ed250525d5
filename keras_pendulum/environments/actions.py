"""Action indices, and the actions of the environment that they stand for."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from keras_pendulum.environments.torque import MAX_TORQUE, ROUNDING
from keras_pendulum.errors import ConfigError


class Actions:
    """The A actions that the outputs of a network stand for.

    Args:
        values: the actions as the environment takes them, [A] or [A, ...]; the indices themselves
            where it takes those, such as CartPole-v1.
    """

    def __init__(self, values: NDArray[Any]) -> None:
        self.values = values

    @property
    def count(self) -> int:
        """Number of actions A."""
        return len(self.values)

    def to_env_action(self, index: int) -> Any:
        """Returns the action as the environment takes it."""
        return self.values[index]

    def stored_index(self, index: int) -> int:
        """Returns the index that the replay buffer stores for the action `index`."""
        return index


class TorqueActions(Actions):
    """Torques [A] in N·m. They are float64: a float32 torque changes the last digits."""

    def __init__(self, torques: NDArray[np.float64]) -> None:
        super().__init__(torques[:, np.newaxis])  # [A, 1]

    @property
    def torques(self) -> NDArray[np.float64]:
        """The torques [A] in N·m."""
        return self.values[:, 0]


class TorqueGrid(TorqueActions):
    """`count` torques evenly spaced from -2 to 2 N·m: `linspace(-2, 2, count)`.

    Gymnasium's `DiscretizeAction` cannot replace it: its values are bin centres, ±1.951 N·m at the
    ends for 41 torques.
    """

    def __init__(self, count: int = 41) -> None:
        super().__init__(np.linspace(-MAX_TORQUE, MAX_TORQUE, count))


class TruncatingTorqueGrid(TorqueActions):
    """The walkthrough's torques k/10 - 2, with its defect `index-truncation`.

    The replay buffer gets an index that is computed back from the torque. Floating-point rounding
    turns index 2 into 1 and index 4 into 3, so the values of 2 and 4 are never learned.
    """

    def __init__(self) -> None:
        super().__init__(np.arange(41) / 10 - 2)

    def stored_index(self, index: int) -> int:
        """Returns the truncated index."""
        return truncated_index(float(self.torques[index]))


def torque_actions(torques: ArrayLike | None, count: int | None = None) -> TorqueActions:
    """Returns the torques [A] in N·m that a user gives; for None, `count` evenly spaced ones.

    Raises ConfigError unless they are numbers from -2 to 2, `count` of them where it is known.
    """
    if torques is None:
        return TorqueGrid(count or 41)
    try:
        array = np.asarray(torques)
    except ValueError:  # lists of several lengths
        array = np.empty(0, object)
    if array.dtype.kind not in "fiu" or array.ndim != 1:
        raise ConfigError(f"torques are {torques!r}; expected a list of numbers (N·m)")
    if not (np.abs(array) <= MAX_TORQUE + ROUNDING).all():  # written so that NaN fails too
        least, largest = array.min(), array.max()
        raise ConfigError(
            f"torques are from {least:g} to {largest:g}; expected numbers from -2 to 2 (N·m)"
        )
    if count is not None and len(array) != count:
        raise ConfigError(f"torques has {len(array)} numbers; the agent has {count} actions")
    return TorqueActions(array.astype(np.float64).clip(-MAX_TORQUE, MAX_TORQUE))


def truncated_index(torque: float | np.floating[Any]) -> int:
    """Returns the walkthrough's index of a torque (N·m): truncated, not rounded."""
    return int((torque + 2) * 10)
