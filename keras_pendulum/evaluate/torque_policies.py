"""Policies without Q-values: functions of an observation, and objects with `predict`."""

from __future__ import annotations

import inspect
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from keras_pendulum.environments.actions import torque_actions
from keras_pendulum.environments.cartpole import CartPole
from keras_pendulum.environments.torque import MAX_TORQUE
from keras_pendulum.errors import ConfigError
from keras_pendulum.evaluate.answers import (
    ActionError,
    Batch,
    call_agent,
    indices_of,
    is_instance,
    name_of,
    torques_of,
)
from keras_pendulum.evaluate.policy import Observations, Policy
from keras_pendulum.evaluate.q_policies import q_function
from keras_pendulum.storage.run_info import RunInfo


class FunctionPolicy(Policy):
    """A function from one observation [D] to a torque in N·m, or to the index of an action.

    It may have a state. With `torques`, its answers are indices of them. Those of CartPole are
    indices, too.
    """

    one_by_one = True

    def __init__(
        self, source: Any, torques: ArrayLike | None = None, info: RunInfo | None = None
    ) -> None:
        super().__init__(name_of(source), info)
        self._source = source
        self._first = 0  # the integer that stands for index 0
        if torques is not None:
            self.actions = torque_actions(torques)

    def act(self, observations: Observations) -> NDArray[Any]:
        """Returns the actions for observations [B, D], as the environment takes them.

        Raises ActionError for an answer that is not an action.
        """
        if not self.one_by_one:
            return self._actions(observations)
        actions = []
        for row, observation in enumerate(observations):
            try:
                actions.append(self._actions(observation))
            except ActionError as error:
                error.row = row
                raise
        return np.stack(actions)

    def _actions(self, observations: Observations) -> NDArray[Any]:
        """Returns the actions for observations [B, D], or that for one, [D]."""
        return self._read(call_agent(self._source, observations), observations.shape[:-1])

    def _read(self, answer: Any, batch: Batch) -> NDArray[Any]:
        """Returns the actions that an answer stands for."""
        if self.actions is None:
            return torques_of(answer, batch)[..., np.newaxis]
        indices = indices_of(answer, batch, self.actions.count, self._first)
        return np.asarray(self.actions.values[indices])


class PredictPolicy(FunctionPolicy):
    """An object with `predict(observation, deterministic=True)`, as Stable-Baselines3 has.

    Without an action space, the object may take one observation at a time only, and its actions are
    indices if `torques` are given, else torques.

    Args:
        source: the object.
        torques: N·m, what the indices stand for; None takes `linspace(-2, 2, A)`.

    One that takes four numbers and has two actions is one of CartPole. The state that a recurrent
    one returns is given back to it in the next step of the episode. A model that learned from the
    observations of Stable-Baselines3's VecNormalize gets them here, too.

    Raises ConfigError when its spaces are not those of a task.
    """

    def __init__(self, source: Any, torques: ArrayLike | None) -> None:
        gamma = getattr(source, "gamma", None)
        info = RunInfo(settings={} if gamma is None else {"discount": gamma})
        super().__init__(source, info=info)
        shape = getattr(getattr(source, "observation_space", None), "shape", (3,))
        space: Any = getattr(source, "action_space", None)
        bounds: Any = [getattr(space, "low", None), getattr(space, "high", None)]
        cartpole = shape == (4,) and torques is None and getattr(space, "n", 0) == 2
        if not cartpole and (shape is None or tuple(shape) != (3,)):
            raise ConfigError(f"{self.name} takes observations of the shape {shape}; expected (3,)")
        if cartpole:
            self.info = replace(info, task=CartPole())
            self.actions = CartPole().actions()
        elif hasattr(space, "n"):
            self.actions = torque_actions(torques, int(space.n))
        elif space is None and torques is not None:
            self.actions = torque_actions(torques)
        elif torques is not None:
            raise ConfigError(f"torques are given, but {self.name} chooses no index: {space}")
        elif space is not None and not np.array_equal(np.ravel(bounds), [-MAX_TORQUE, MAX_TORQUE]):
            raise ConfigError(
                f"{self.name} has the actions {space}; expected one torque from -2 to 2 N·m: give "
                "a function that returns the torque"
            )
        # Of sb3_contrib's RecurrentPPO.
        recurrent = hasattr(getattr(source, "policy", None), "lstm_actor")
        self.one_by_one = space is None or recurrent
        self._takes_state = "state" in inspect.signature(source.predict).parameters
        self._state: Any = None
        normalized = getattr(source, "get_vec_normalize_env", lambda: None)()
        self._seen = (lambda each: each) if normalized is None else normalized.normalize_obs
        self._first = int(getattr(space, "start", 0))
        network: Any = getattr(source, "q_net", None)  # of Stable-Baselines3's DQN
        self.has_q_values = self.actions is not None and is_instance(network, "torch.nn", "Module")
        self._values = q_function(network, torques).q_values if self.has_q_values else None

    def q_values(self, observations: ArrayLike) -> NDArray[Any]:
        """Returns the Q-values of Stable-Baselines3's DQN."""
        if self._values is None:
            return super().q_values(observations)
        return self._values(self._seen(np.asarray(observations, np.float32)))

    def reset(self) -> None:
        """Starts a new episode."""
        self._state = None

    def _actions(self, observations: Observations) -> NDArray[Any]:
        options = {} if self._state is None else {"state": self._state}
        seen = self._seen(observations)
        answer = call_agent(self._source.predict, seen, deterministic=True, **options)
        if not isinstance(answer, tuple) or not answer:
            raise ActionError(
                f"predict returned a {name_of(type(answer))}; expected a pair (action, state)"
            )
        self._state = answer[1] if len(answer) > 1 and self._takes_state else None
        if self._state is not None and not self.one_by_one:
            raise ActionError(
                "predict returned a state, as a recurrent agent does; give a function of one "
                "observation that keeps it"
            )
        return self._read(answer[0], observations.shape[:-1])


def has_predict(source: Any) -> bool:
    """Returns whether `predict` takes `deterministic`, unlike that of other libraries."""
    try:
        parameters = inspect.signature(source.predict).parameters.values()
    except (AttributeError, TypeError, ValueError):
        return False
    return any(each.name == "deterministic" or each.kind == each.VAR_KEYWORD for each in parameters)
