"""The seeded random-number generators of a run."""

from __future__ import annotations

import random
from typing import Any

import numpy as np
from numpy.typing import NDArray


class RandomStreams:
    """One stream for exploration and one for the replay buffer, both started from `seed`.

    They are NumPy's legacy generator and Python's, in the order of the recorded run of the
    original. So the preset `original` repeats that run.
    """

    def __init__(self, seed: int) -> None:
        self.exploration = np.random.RandomState(seed)
        self.replay = random.Random(seed)

    def get_state(self) -> dict[str, Any]:
        """Returns the state of both streams in types that JSON can hold."""
        name, keys, *rest = self.exploration.get_state(legacy=True)
        words = np.asarray(keys).tolist()
        return {"exploration": [name, words, *rest], "replay": self.replay.getstate()}

    def set_state(self, state: dict[str, Any]) -> None:
        """Restores a state of `get_state`, also after a round trip through JSON.

        Raises ValueError, and changes nothing, for a state that a stream cannot have.
        """
        name, keys, position, has_gauss, gauss = state["exploration"]
        words: NDArray[np.uint32] = np.asarray(keys, np.uint32)
        # NumPy does not check these.
        if name != "MT19937" or words.shape != (624,) or not 0 <= position <= 624:
            raise ValueError("the state of the exploration stream is not one of MT19937")
        version, internal, gauss_next = state["replay"]
        self.replay.setstate((version, tuple(internal), gauss_next))  # checks before it changes
        self.exploration.set_state((name, words, position, has_gauss, gauss))
