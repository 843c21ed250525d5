"""The one source of every random draw of a run."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray


class RandomSource:
    """Seeded draws for exploration and replay; initial weights and environment use its `seed`.

    Exploration draws from NumPy's legacy stream and batches from Python's, in the order of the
    recorded run of the original, so that a run of the preset `original` can repeat it.
    """

    def __init__(self, seed: int) -> None:
        self.seed = seed
        self._exploration = np.random.RandomState(seed)
        self._replay = random.Random(seed)
        self._put_back: list[list[int]] = []  # batches, the next one last
        self.uniform = self._exploration.random_sample  # [0, 1), the draw compared with ε

    def action(self, count: int) -> int:
        """A uniformly random action index below `count`."""
        return int(self._exploration.randint(0, count))

    def batch_positions(self, stored: int, batch_size: int) -> list[int]:
        """Positions of one batch among `stored` transitions, without replacement: [B]."""
        if self._put_back:
            return self._put_back.pop()
        return self._replay.sample(range(stored), batch_size)

    def put_back(self, batches: Sequence[list[int]]) -> None:
        """Takes the last batches handed out, in their order, for when they are asked for again."""
        self._put_back.extend(reversed(batches))

    def exploration_snapshot(self) -> Callable[[], None]:
        """What, called later, has the draws for exploration go on from here once more."""
        state = self._exploration.get_state(legacy=True)
        return lambda: self._exploration.set_state(state)

    def get_state(self) -> dict[str, Any]:
        """The state of both streams and the batches put back, in JSON's types."""
        name, keys, position, has_gauss, gauss = self._exploration.get_state(legacy=True)
        return {
            "exploration": [name, np.asarray(keys).tolist(), position, has_gauss, gauss],
            "replay": self._replay.getstate(),
            "put_back": list(self._put_back),
        }

    def set_state(self, state: dict[str, Any]) -> None:
        """Goes on from a state of `get_state`, also one that has been through JSON."""
        name, keys, position, has_gauss, gauss = state["exploration"]
        words: NDArray[np.uint32] = np.asarray(keys, np.uint32)
        self._exploration.set_state((name, words, position, has_gauss, gauss))
        version, internal, gauss_next = state["replay"]
        self._replay.setstate((version, tuple(internal), gauss_next))
        # Runs of earlier versions never had any.
        self._put_back = [list(map(int, batch)) for batch in state.get("put_back", [])]
