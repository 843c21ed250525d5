"""The replay buffer: the last transitions, in ring arrays."""

from __future__ import annotations

import random
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray


class Transitions(NamedTuple):
    """Transitions of any leading shape [...], such as [B] for a batch or [K, B] for K batches.

    The replay buffer returns arrays; inside the compiled update they are tensors.
    """

    observation: Any  # [..., D] float32
    action: Any  # [...] int32, index of the action
    reward: Any  # [...] float32
    next_observation: Any  # [..., D] float32
    terminated: Any  # [...] bool; false for a truncated episode


class ReplayBuffer:
    """A ring of the last `capacity` transitions (Mnih et al. 2015, Methods).

    `observation_size` is D, how many numbers an observation has.
    """

    def __init__(self, capacity: int, observation_size: int) -> None:
        self.capacity = capacity
        self.added = 0  # transitions since the start of the run
        self._arrays = Transitions(
            observation=np.zeros((capacity, observation_size), np.float32),
            action=np.zeros(capacity, np.int32),
            reward=np.zeros(capacity, np.float32),
            next_observation=np.zeros((capacity, observation_size), np.float32),
            terminated=np.zeros(capacity, bool),
        )

    def __len__(self) -> int:
        return min(self.added, self.capacity)

    def add(self, *transition: Any) -> None:
        """Stores the fields of one of the `Transitions`, in place of the oldest when full."""
        i = self.added % self.capacity
        # Without a loop, because this is done at each step.
        observations, actions, rewards, next_observations, ends = self._arrays
        observations[i], actions[i], rewards[i], next_observations[i], ends[i] = transition
        self.added += 1

    def sample(self, batch_size: int, rng: random.Random, batches: int = 1) -> Transitions:
        """Returns `batches` batches [K, B, ...], each drawn without replacement.

        Raises ValueError when fewer than `batch_size` transitions are stored.
        """
        stored = range(len(self))  # 0 is the oldest, as in the recorded run
        positions = [rng.sample(stored, batch_size) for _ in range(batches)]  # [K, B]
        slots = self._slots(np.array(positions))
        return Transitions(*(array.take(slots, axis=0) for array in self._arrays))

    def transitions(self) -> Transitions:
        """Returns copies of all stored transitions, oldest first."""
        slots = self._slots(np.arange(len(self)))
        return Transitions(*(array.take(slots, axis=0) for array in self._arrays))

    def get_state(self) -> dict[str, Any]:
        """Returns the number `added`, and the fields of `transitions` by their names."""
        return {"added": self.added, **self.transitions()._asdict()}

    def set_state(self, state: dict[str, Any]) -> None:
        """Restores a state of `get_state`.

        Raises ValueError, and changes nothing, when a buffer of this capacity cannot hold it.
        """
        added = state["added"]
        arrays = self._arrays._asdict()
        for name, array in arrays.items():
            if state[name].shape != (min(added, self.capacity), *array.shape[1:]):
                raise ValueError(f"{name} of {added} transitions has shape {state[name].shape}")
        self.added = added
        slots = self._slots(np.arange(len(self)))
        for name, array in arrays.items():
            array[slots] = state[name]

    def _slots(self, positions: NDArray[np.integer]) -> NDArray[np.integer]:
        """Returns the rows of the arrays at these positions, of which 0 is the oldest."""
        return (self.added - len(self) + positions) % self.capacity
