"""A policy: whatever acts. Observations in, actions out."""

from __future__ import annotations

import copy
from abc import ABC, abstractmethod
from dataclasses import replace
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from keras_pendulum.environments.actions import Actions, TorqueActions, torque_actions
from keras_pendulum.environments.pendulum import Pendulum
from keras_pendulum.environments.task import Task
from keras_pendulum.environments.tasks import declared_task
from keras_pendulum.errors import ConfigError
from keras_pendulum.storage.run_info import RunInfo

Observations = NDArray[np.float32]  # [B, D]


class Policy(ABC):
    """An agent that acts. `load_policy` and `q_function` return one.

    A policy of a network has a copy of the weights, so later updates do not change it.

    Attributes:
        name: for messages and pictures.
        info: the recorded run that the policy comes from.
        actions: what the outputs of its Q-network stand for; None where it has none.
        has_q_values: whether `q_values` returns values.
        one_by_one: whether one episode is played after the other. The policy may have a state, or
            it is faster with one observation than with a batch.
    """

    has_q_values = False
    one_by_one = False
    _has_own_torques = True  # not only what its outputs stand for by default

    def __init__(self, name: str, info: RunInfo | None = None, actions: Actions | None = None):
        self.name = name
        self.info = info or RunInfo()
        self.actions = actions

    @property
    def task(self) -> Task:
        """The recorded task; a policy that records none is taken for one of the pendulum, g = 1."""
        return self.info.task or Pendulum()

    @abstractmethod
    def act(self, observations: Observations) -> NDArray[Any]:
        """Returns the actions for observations [B, D], as the environment takes them.

        They are [B, 1] N·m for the pendulum and [B] for CartPole. The observations are not checked.

        Raises ActionError for an answer that is not an action, with its row in the batch.
        """

    def action(self, observation: NDArray[np.float32]) -> Any:
        """Returns the action for one observation [D], without checks."""
        return self.act(observation[np.newaxis])[0]

    def q_values(self, observations: ArrayLike) -> NDArray[Any]:
        """Returns the Q-value of each action: [B, A], or [A] for one observation.

        Raises ValueError as a call does, and TypeError for a policy without Q-values.
        """
        raise TypeError(f"{self.name} has no Q-values")

    def with_environment(self, environment: str) -> Self:
        """Returns the policy as one of an environment, such as `CartPole-v1`.

        Raises ConfigError for an unknown environment, and where it is one of another.
        """
        task = declared_task(environment)
        recorded = self.info.task
        if recorded is None and task.environment != self.task.environment:
            return self._of_task(task)
        if self.task.environment != environment:
            raise ConfigError(
                f"{self.name} is an agent of {self.task.environment}, not of {environment}"
            )
        return self

    def _of_task(self, task: Task) -> Self:
        """Returns the policy, which records no task, as one of another task."""
        if self._has_own_torques and self.actions is not None:
            raise ConfigError(f"{self.name} has torques, which belong to {self.task.environment}")
        changed = copy.copy(self)
        changed.info, changed.actions = replace(self.info, task=task), task.actions()
        return changed

    def with_torques(self, torques: ArrayLike) -> Self:
        """Returns the policy with other torques (N·m) for its outputs.

        Raises ConfigError for torques that do not fit, and where it has others.
        """
        if self._has_own_torques:
            raise ConfigError(f"torques are given, but {self.name} has torques of its own")
        if not isinstance(self.actions, TorqueActions):
            raise ConfigError(f"torques belong to Pendulum-v1; {self.task.environment} has none")
        changed = copy.copy(self)
        changed.actions = torque_actions(torques, self.actions.count)
        return changed

    def reset(self) -> None:  # noqa: B027 - most policies have no state
        """Starts a new episode. A policy with a state forgets it here."""

    def __call__(self, observation: ArrayLike) -> Any:
        """Returns the action for an observation [D], as the environment takes it.

        For the pendulum it is the torque in N·m, float32: [1], or [B, 1] for a batch [B, D]. For
        CartPole it is the action's index: an int, or int64 [B] for a batch.

        The observation is an array or a list of numbers, which are rounded to float32.

        Raises ValueError for another shape, for NaN or infinite numbers, and for other types.
        """
        actions, _ = self.predict(observation)
        return actions if actions.ndim else int(actions)

    def predict(
        self,
        observation: Any,  # the protocol of Stable-Baselines3 allows a dict too
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[Any], Any]:
        """Returns the action and `state`, as `predict` of Stable-Baselines3 does.

        The action is that of a call, always as an array. The last three arguments do not change it.
        """
        array = self._validate(observation)
        actions = self.act(np.atleast_2d(array))
        if actions.dtype.kind == "f":  # the type of the environment's action space
            actions = actions.astype(np.float32)
        return np.asarray(actions if array.ndim == 2 else actions[0]), state

    def _validate(self, observation: ArrayLike) -> NDArray[np.float32]:
        """Returns the observation as float32 [D] or [B, D]."""
        size = self.task.observation_size
        expected = f"expected real numbers of the shape [{size}], or [B, {size}] for a batch"
        try:
            array = np.asarray(observation)
        except ValueError as error:  # such as the pair that `env.reset()` returns
            kind = type(observation).__name__
            raise ValueError(f"observation is a {kind}; {expected}") from error
        if array.dtype.kind not in "fiu":
            raise ValueError(f"observation has the type {array.dtype}; {expected}")
        if array.ndim not in (1, 2) or array.shape[-1] != size:
            raise ValueError(f"observation has the shape {list(array.shape)}; {expected}")
        with np.errstate(over="ignore"):  # a number too large for float32 becomes infinite
            array = array.astype(np.float32, copy=False)
        if not np.isfinite(array).all():
            raise ValueError("observation holds NaN or infinite numbers; expected finite ones")
        return array
