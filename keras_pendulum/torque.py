"""The torque grid: an action's index on one side, its torque in N·m on the other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

MAX_TORQUE = 2.0  # N·m, the limit of Pendulum-v1


class TorqueGrid:
    """`count` torques evenly spaced from -2 to 2 N·m, `linspace(-2, 2, count)`.

    Gymnasium's `DiscretizeAction` uses bin centres, ±1.951 N·m at the ends for 41
    torques, and cannot stand in for this.
    """

    def __init__(self, count: int = 41) -> None:
        self.torques: NDArray[np.float64] = np.linspace(-MAX_TORQUE, MAX_TORQUE, count)  # [A] N·m

    @property
    def count(self) -> int:
        """Number of actions A."""
        return len(self.torques)

    def control(self, index: int) -> NDArray[np.float64]:
        """The action `index` as the environment takes it: [1], N·m.

        float64, as the original sends it: a float32 torque changes the physics' last digits.
        """
        return self.torques[index : index + 1]

    def nearest_index(self, torque: float) -> int:
        """The index whose torque is nearest to `torque` (N·m).

        Raises ValueError for a torque that is not finite or outside ±2 N·m.
        """
        if not abs(torque) <= MAX_TORQUE:  # written so that NaN fails too
            raise ValueError(f"torque {torque} N·m; expected a number from -2 to 2")
        step = 2 * MAX_TORQUE / (self.count - 1)
        return round((torque + MAX_TORQUE) / step)

    def remembered_index(self, index: int) -> int:
        """What the replay buffer keeps for the action `index`: the index itself."""
        return index
