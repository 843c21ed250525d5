"""The replay buffer: the last transitions, in ring arrays."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray


class Transitions(NamedTuple):
    """Transitions of any leading shape [...]: a batch [B], or the batches of an episode [K, B].

    Arrays from the buffer, tensors inside the update.
    """

    observation: Any  # [..., D] float32
    action: Any  # [...] int32, the action's index
    reward: Any  # [...] float32
    next_observation: Any  # [..., D] float32
    terminated: Any  # [...] bool, true where no value follows; truncation is not termination


class ReplayBuffer:
    """Holds the last `capacity` transitions (Mnih et al. 2015, Methods).

    Args:
        capacity: how many.
        observation_size: D.
        spare: how many of the last ones can be taken back: as many more are kept.
    """

    def __init__(self, capacity: int, observation_size: int = 3, spare: int = 0) -> None:
        self.capacity = capacity
        self._slots = capacity + spare
        self._added = 0
        self._arrays = Transitions(
            observation=np.zeros((self._slots, observation_size), np.float32),
            action=np.zeros(self._slots, np.int32),
            reward=np.zeros(self._slots, np.float32),
            next_observation=np.zeros((self._slots, observation_size), np.float32),
            terminated=np.zeros(self._slots, bool),
        )

    def __len__(self) -> int:
        return min(self._added, self.capacity)

    def add(
        self,
        observation: ArrayLike,
        action: int,
        reward: float,
        next_observation: ArrayLike,
        terminated: bool,
    ) -> None:
        """Stores one transition, in the place of the oldest when the buffer is full."""
        slot = self._added % self._slots
        arrays = self._arrays
        arrays.observation[slot] = observation
        arrays.action[slot] = action
        arrays.reward[slot] = reward
        arrays.next_observation[slot] = next_observation
        arrays.terminated[slot] = terminated
        self._added += 1

    def take_back(self, count: int) -> None:
        """Forgets the last `count` ≤ `spare` transitions; what they had pushed out is back."""
        self._added -= count

    def at(self, positions: ArrayLike) -> Transitions:
        """The transitions at `positions` [...], counted from the oldest (0) on.

        Raises IndexError for a position that holds none.
        """
        wanted: NDArray[np.int64] = np.asarray(positions, np.int64)
        if wanted.size and not 0 <= wanted.min() <= wanted.max() < len(self):
            raise IndexError(f"position outside the {len(self)} stored transitions")
        return self.numbered(self.oldest + wanted)

    def numbered(self, numbers: NDArray[np.int64]) -> Transitions:
        """Transitions by their numbers [...] since the start of the run.

        Besides those stored, the last `spare` that were pushed out are still there.
        """
        slots = numbers % self._slots
        return Transitions(*(array.take(slots, axis=0) for array in self._arrays))

    def get_state(self) -> dict[str, NDArray[Any]]:
        """All stored transitions, oldest first, one array a field."""
        start = self.oldest % self._slots
        end = start + len(self)
        return {
            name: np.concatenate([array[start:end], array[: max(0, end - self._slots)]])
            for name, array in self._arrays._asdict().items()
        }

    def set_state(self, state: dict[str, NDArray[Any]], added: int) -> None:
        """Takes the transitions of `get_state`; `added` is how many were ever added.

        Raises ValueError when they are not what a buffer of this capacity can hold.
        """
        stored = min(added, self.capacity)
        for name, array in self._arrays._asdict().items():
            if state[name].shape != (stored, *array.shape[1:]):
                raise ValueError(f"{name} of {added} transitions has shape {state[name].shape}")
        self._added = added
        slots = (added - stored + np.arange(stored)) % self._slots
        for name, array in self._arrays._asdict().items():
            array[slots] = state[name]

    @property
    def oldest(self) -> int:
        """The number of the oldest stored transition, 0 being the first of the run."""
        return self._added - len(self)

    @property
    def added(self) -> int:
        """Transitions added since the start of the run."""
        return self._added
