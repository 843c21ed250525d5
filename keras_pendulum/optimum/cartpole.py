"""The solution of CartPole: every start can be balanced to the end."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.optimum.solution import Solution


class CartPoleSolution(Solution):
    """The best return is 1 for each step of the episode."""

    def best_returns(self, seeds: Iterable[int], steps: int | None = None) -> NDArray[np.float64]:
        """Returns the number of steps for each seed."""
        return np.full(len(list(seeds)), float(steps or self.task.steps_per_episode))
