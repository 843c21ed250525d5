"""Which effort acted in a stored transition: the dynamics of a task, read backwards."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.diagnosis.signals import Array
from keras_pendulum.dqn.replay_buffer import Transitions
from keras_pendulum.optimum.known_dynamics import KnownDynamics

FEW = 200  # transitions that show nothing for sure
_MOST_TRANSITIONS = 20_000  # whose motion is checked
_MOST_STEPS = 20  # of one transition
_SAME_STATE = 2e-3  # m, rad or their speeds

Rows = NDArray[np.intp]


class Motion(ABC):
    """The motion of stored transitions.

    Args:
        dynamics: the declared task.
        replay: the transitions [N, ...]; an action is an index of `efforts`.
        stored: the stored efforts [N].
        efforts: those of the outputs, [A].
    """

    def __init__(
        self, dynamics: KnownDynamics, replay: Transitions, stored: Array, efforts: Array
    ) -> None:
        self.dynamics, self.efforts = dynamics, efforts
        self.replay = Transitions(*(array[-_MOST_TRANSITIONS:] for array in replay))
        self.stored = stored[-_MOST_TRANSITIONS:]

    @classmethod
    @abstractmethod
    def explains(
        cls, dynamics: KnownDynamics, before: Array, action: NDArray[Any], after: Array
    ) -> bool:
        """Returns whether nearly all transitions can happen, with any effort for each action.

        Args:
            dynamics: the task.
            before: observations [N, D].
            action: indices or efforts [N].
            after: the next observations.
        """

    @classmethod
    @abstractmethod
    def wrong_observations(cls, before: Array, after: Array) -> str:
        """Returns an empty text; for observations of another kind, what is wrong and expected."""

    @abstractmethod
    def obeying(self) -> float:
        """Returns the share of transitions that obey the dynamics with the stored effort."""

    @abstractmethod
    def fit(self) -> tuple[float | None, float]:
        """Returns the gravity that acted, and the correlation of stored and acting efforts.

        The gravity is None where the task has only one. The correlation is 1 in a healthy buffer,
        and 0 where nothing is shown.
        """

    @abstractmethod
    def acted_actions(self) -> tuple[Rows, Rows] | None:
        """Returns transitions that show what acted, [M], and the actions that acted there.

        Returns None where they are less than 200, or nearly none is explained by an action.
        """

    @abstractmethod
    def index_efforts(self) -> Array | None:
        """Returns the effort [A] that acted where each index was stored.

        An index that was not stored keeps its declared effort. Returns None unless nearly each
        stored index belongs to one effort alone.
        """

    def action_lasts(self) -> bool:
        """Returns whether an action lasts for several steps, for as many in most transitions."""
        observation, following = self.replay.observation[-1000:], self.replay.next_observation
        states, efforts = self.dynamics.states_of(observation), self.stored[-1000:, None]
        for step in range(_MOST_STEPS):
            states = self.dynamics.outcomes(states, efforts).state[:, 0]
            distance = np.abs(self.dynamics.observe(states) - following[-1000:]).max(axis=1)
            if np.mean(distance < _SAME_STATE) > 0.5:
                return step > 0
        return False

    def lost_actions(self) -> list[int]:
        """Returns the actions that acted, but were always stored as one other action.

        No action is returned for half of the actions or more, and where `acted_actions` shows
        nothing.
        """
        found = self.acted_actions()
        if found is None:
            return []
        rows, acted = found
        stored = self.replay.action[rows]
        never_stored = set(acted.tolist()) - set(self.replay.action.tolist())
        lost = sorted(
            action
            for action in never_stored
            if (acted == action).sum() > 1 and np.ptp(stored[acted == action]) == 0
        )
        return lost if len(lost) < len(self.efforts) / 2 else []
