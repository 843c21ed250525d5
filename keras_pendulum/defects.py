"""The original's defects, as parts that a preset swaps in.

`update-starvation` is a number (`updates_per_episode=1`) and `no-target-network` is a choice of
network (`target_update="none"` makes the online network its own target), so neither needs a
part. The defects that no preset can run (`torque-offset`, `hard-coded-batch`,
`unsaved-final-weights`, `unseeded`) are shown in tests/test_defects.py.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from keras_pendulum.torque import TorqueGrid


def truncated_index(torque: float | np.floating[Any]) -> int:
    """The walkthrough's way from a torque (N·m) back to its index: cut off, not rounded."""
    return int((torque + 2) * 10)


class TruncatingTorqueGrid(TorqueGrid):
    """`index-truncation`: torques k/10 - 2, and a memory that gets the index from the torque.

    The float error of k/10 - 2 + 2 sends index 2 to 1 and 4 to 3, so those two torques are
    never learned about and their outcomes are credited to their neighbours.
    """

    def __init__(self) -> None:
        super().__init__(41)
        self.torques = np.arange(41) / 10 - 2  # [A] N·m

    def remembered_index(self, index: int) -> int:
        """The index that truncation makes of this action's torque."""
        return truncated_index(float(self.torques[index]))
