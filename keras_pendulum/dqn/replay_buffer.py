"""The replay buffer: the last transitions, in ring arrays."""

from __future__ import annotations

import random
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray


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

    Args:
        capacity: number of transitions.
        observation_size: D.
    """

    def __init__(self, capacity: int, observation_size: int = 3) -> None:
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

    def add(
        self,
        observation: ArrayLike,
        action: int,
        reward: float,
        next_observation: ArrayLike,
        terminated: bool,
    ) -> None:
        """Stores one transition; it replaces the oldest one when the buffer is full."""
        slot = self.added % self.capacity
        arrays = self._arrays
        arrays.observation[slot] = observation
        arrays.action[slot] = action
        arrays.reward[slot] = reward
        arrays.next_observation[slot] = next_observation
        arrays.terminated[slot] = terminated
        self.added += 1

    def sample(self, batch_size: int, rng: random.Random, batches: int = 1) -> Transitions:
        """Returns `batches` batches [K, B, ...], each drawn without replacement.

        Raises ValueError when fewer than `batch_size` transitions are stored.
        """
        stored = range(len(self))  # 0 is the oldest, as in the recorded run
        positions = np.array([rng.sample(stored, batch_size) for _ in range(batches)])  # [K, B]
        slots = (self.added - len(self) + positions) % self.capacity
        return Transitions(*(array.take(slots, axis=0) for array in self._arrays))

    def get_state(self) -> dict[str, NDArray[Any]]:
        """Returns copies of all stored transitions, oldest first, one array per field."""
        oldest = (self.added - len(self)) % self.capacity
        return {
            name: np.concatenate([array[oldest : len(self)], array[:oldest]])
            for name, array in self._arrays._asdict().items()
        }

    def set_state(self, state: dict[str, NDArray[Any]], added: int) -> None:
        """Restores the transitions of `get_state` and the number `added`.

        Raises ValueError when a buffer of this capacity cannot hold them.
        """
        stored = min(added, self.capacity)
        for name, array in self._arrays._asdict().items():
            if state[name].shape != (stored, *array.shape[1:]):
                raise ValueError(f"{name} of {added} transitions has shape {state[name].shape}")
        self.added = added
        slots = (added - stored + np.arange(stored)) % self.capacity
        for name, array in self._arrays._asdict().items():
            array[slots] = state[name]
