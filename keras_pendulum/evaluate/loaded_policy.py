"""The greedy policy of a network as other programs call it: observations in, actions out."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from keras_pendulum.dqn.network import DQN
from keras_pendulum.dqn.policy import greedy_policy
from keras_pendulum.environments.actions import make_actions
from keras_pendulum.errors import require_type
from keras_pendulum.storage.weights import load_weights, require_finite


class Policy:
    """The greedy policy of a DQN, computed by NumPy without a call into TensorFlow.

    It keeps a copy of the weights, so later updates of the network do not change it.

    An observation is an array or a list of numbers, [D] for one or [B, D] for a batch; D is 3 for
    the pendulum and 4 for CartPole. It is rounded to float32. The methods raise ValueError for
    another shape, for NaN or infinite numbers, and for anything but real numbers.

    Args:
        network: the Q-network; its number of outputs A determines the torques.

    Attributes:
        provenance: the run that the network comes from, with environment and gravity.
        greedy: the policy from observations to action indices, without the checks.
        actions: the actions that the indices stand for.

    Raises UserError when a weight is not finite, and TypeError when `network` is no DQN.
    """

    def __init__(self, network: DQN) -> None:
        require_type("network", network, DQN)
        require_finite(network.get_weights())
        self.provenance = network.provenance
        self.greedy = greedy_policy(network)
        self.actions = make_actions(network.provenance.environment, network.action_count)
        self._observation_size = network.observation_size
        indices = range(self.actions.count)
        self._env_actions = np.array([self.actions.to_env_action(index) for index in indices])

    def __call__(self, observation: ArrayLike) -> Any:
        """Returns the action with the highest Q-value, as the environment takes it.

        For the pendulum it is the torque in N·m, float64: [1], or [B, 1] for a batch. For CartPole
        it is the action's index: an int, or int64 [B] for a batch.
        """
        actions = self._choose(observation)
        return actions if actions.ndim else int(actions)

    def q_values(self, observation: ArrayLike) -> NDArray[np.float32]:
        """Returns the Q-value of each action: [A], or [B, A] for a batch."""
        return self.greedy.q_values(self._validate(observation))

    def predict(
        self,
        observation: Any,  # the protocol of Stable-Baselines3 allows a dict too
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[Any], Any]:
        """Returns the action and `state`, as `predict` of Stable-Baselines3 does.

        The action is that of a call, always as an array. The policy has no state and is always
        greedy, so the last three arguments do not change the action.
        """
        return self._choose(observation), state

    def _choose(self, observation: ArrayLike) -> NDArray[Any]:
        """Returns the action as an array of its own, for CartPole and one observation a scalar."""
        indices = self.q_values(observation).argmax(axis=-1)
        return np.asarray(self._env_actions.take(indices, axis=0))

    def _validate(self, observation: ArrayLike) -> NDArray[np.float32]:
        """Returns the observation as float32 [D] or [B, D]."""
        size = self._observation_size
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


def load_policy(path: str | os.PathLike[str], activation: str | None = None) -> Policy:
    """Returns the greedy policy of a weights file; the arguments are those of `load_weights`.

    Raises WeightsError as `load_weights` does.

    >>> policy = kp.load_policy("reference")
    >>> policy([-1.0, 0.0, 0.0]).shape  # hanging at rest; a torque in N·m
    (1,)
    """
    return Policy(load_weights(path, activation))
