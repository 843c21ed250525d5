"""Policies that take the action with the highest Q-value, whichever library computes it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from keras_pendulum.dqn.network import DQN
from keras_pendulum.dqn.policy import GreedyPolicy
from keras_pendulum.environments.actions import Actions, torque_actions
from keras_pendulum.environments.cartpole import CartPole
from keras_pendulum.environments.task import Task
from keras_pendulum.errors import ConfigError, require_finite
from keras_pendulum.evaluate.answers import (
    ActionError,
    best_of,
    call_agent,
    is_instance,
    name_of,
    q_values_of,
)
from keras_pendulum.evaluate.policy import Observations, Policy
from keras_pendulum.storage.run_info import RunInfo

# Two states to try an agent with, one with each sign.
_EXAMPLES = np.array([[1, 0, 0.5], [-0.6, -0.8, -3]], np.float32)  # [2, 3]
_CARTPOLE_EXAMPLES = np.array([[1, 0.5, 0.1, 0.2], [-1, -0.5, -0.1, -2]], np.float32)  # [2, 4]


class DQNPolicy(Policy):
    """The greedy policy of a DQN, computed by NumPy without a call into TensorFlow.

    Args:
        network: the network.
        name: for messages; None takes its preset.

    Raises UserError when a weight is not finite.
    """

    has_q_values = True
    one_by_one = True
    _has_own_torques = False
    actions: Actions

    def __init__(self, network: DQN, name: str | None = None) -> None:
        self.weights = network.get_weights()  # copies
        self.activation = network.activation
        require_finite(self.weights)
        info = RunInfo.from_record(network.metadata)
        super().__init__(name or info.preset or "DQN", info)
        self.actions = self.task.actions(network.action_count)
        self._greedy = GreedyPolicy(self.weights, self.activation)

    def _of_task(self, task: Task) -> Self:
        raise ConfigError(
            f"{self.name} takes {self.task.observation_size} numbers; {task.environment} has "
            f"{task.observation_size}"
        )

    def q_values(self, observations: ArrayLike) -> NDArray[np.float32]:
        """Returns the Q-value of each action: [B, A], or [A] for one observation."""
        return self._greedy.q_values(self._validate(observations))

    def act(self, observations: Observations) -> NDArray[Any]:
        """Returns the actions with the highest Q-values."""
        indices = self._greedy.q_values(observations).argmax(axis=1)
        return self.actions.values.take(indices, axis=0)

    def action(self, observation: NDArray[np.float32]) -> Any:
        """Returns the action with the highest Q-value for one observation [D]."""
        return self.actions.to_env_action(self._greedy.action(observation))


class QPolicy(Policy):
    """The greedy policy of a function from observations [B, D] to Q-values [B, A].

    It is one of the pendulum where it answers to three numbers, else one of CartPole. Its arguments
    and errors are those of `q_function`.
    """

    has_q_values = True
    actions: Actions

    def __init__(
        self, function: Callable[[Any], Any], torques: ArrayLike | None, name: str
    ) -> None:
        super().__init__(name)
        self._has_own_torques = torques is not None
        self._function = function
        try:
            values = _values(function, _EXAMPLES)
        except ActionError as error:
            if self._has_own_torques:
                raise
            try:
                values = _values(function, _CARTPOLE_EXAMPLES)
            except ActionError:
                raise error from None
            q_values_of(values, len(_CARTPOLE_EXAMPLES), 2)
            self.info, self.actions = RunInfo(CartPole()), CartPole().actions()
        else:
            self.actions = torque_actions(torques, values.shape[1])

    def _of_task(self, task: Task) -> Self:
        """Returns the policy as one of CartPole. Raises ActionError where it has other values."""
        changed = super()._of_task(task)
        changed.q_values(_CARTPOLE_EXAMPLES)
        return changed

    def q_values(self, observations: ArrayLike) -> NDArray[Any]:
        """Returns the Q-values [B, A] of observations [B, D].

        Raises ActionError when the function raises an exception or returns anything else.
        """
        return _values(self._function, np.asarray(observations, np.float32), self.actions.count)

    def act(self, observations: Observations) -> NDArray[Any]:
        """Returns the actions with the highest Q-values."""
        return self.actions.values.take(best_of(self.q_values(observations)), axis=0)


def _values(
    function: Callable[[Any], Any], observations: Observations, count: int | None = None
) -> NDArray[Any]:
    """Returns the Q-values [B, A] of a function; `count` is A, where it is known."""
    return q_values_of(call_agent(function, observations), len(observations), count)


def q_function(
    function: Callable[[Any], Any], torques: ArrayLike | None = None, name: str | None = None
) -> Policy:
    """Returns a policy for `evaluate_policy` from a function of Q-values.

    Args:
        function: gets observations, float32 [B, 3], as a NumPy array, and returns Q-values [B, A]
            as an array of NumPy, PyTorch, TensorFlow or JAX. One of CartPole gets [B, 4]. A
            `torch.nn.Module` gets a tensor on its own device, in its evaluation mode and without
            gradients.
        torques: N·m, one for each output, -2 to 2; None takes `linspace(-2, 2, A)`.
        name: for messages; None takes the function's.

    Raises ConfigError for wrong torques. Raises UserError when the function cannot be called so, or
    returns anything else.

    >>> policy = kp.q_function(lambda observations: observations, torques=[-2, 0, 2])
    >>> kp.evaluate_policy(policy, episodes=1).regret > 100
    True
    """
    if not callable(function):
        raise TypeError(f"function is {function!r}; expected a function of observations")
    call = _torch_call(function) if is_instance(function, "torch.nn", "Module") else function
    return QPolicy(call, torques, name or name_of(function))


def _torch_call(module: Any) -> Callable[[NDArray[np.float32]], Any]:
    """Returns a function that calls a PyTorch module and leaves its modes as they were."""
    import torch

    weights = next(module.parameters(), torch.empty(0, dtype=torch.float32))

    def call(observations: NDArray[np.float32]) -> Any:
        modes = [(part, part.training) for part in module.modules()]
        module.eval()
        try:
            with torch.no_grad():
                return module(torch.tensor(observations).to(weights))
        finally:
            for part, training in modes:
                part.training = training

    return call
