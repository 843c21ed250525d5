"""Agents with the `predict` of Stable-Baselines3."""

from __future__ import annotations

import inspect
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from keras_pendulum.environments.actions import MAX_TORQUE
from keras_pendulum.errors import ConfigError
from keras_pendulum.evaluate.answers import (
    ActionError,
    call_agent,
    checked_indices,
    name_of,
    torques_of,
)
from keras_pendulum.evaluate.q_functions import (
    QFunction,
    checked_grid,
    is_torch_module,
    q_function,
)
from keras_pendulum.optimum.discounted import validate_discount


class Predictor:
    """An object with `predict(observation, deterministic=True)`, called for torques.

    Without an action space, the object may take one observation at a time only, and its actions are
    indices if `torques` are given, else torques.

    Args:
        source: the object.
        torques: N·m, what the indices stand for; None takes `linspace(-2, 2, A)`.

    Attributes:
        batched: whether the object takes observations [B, 3].
        torques: [A] N·m of the indices; None for continuous torque.
        discount: γ that it learned with; None where it is unknown.
        q_values: its Q-function; None where it has none.

    Raises ConfigError when its spaces are not those of the pendulum.
    """

    def __init__(self, source: Any, torques: ArrayLike | None) -> None:
        name, space = name_of(source), getattr(source, "action_space", None)
        shape = getattr(getattr(source, "observation_space", None), "shape", (3,))
        if shape is None or tuple(shape) != (3,):
            raise ConfigError(f"{name} takes observations of the shape {shape}; expected (3,)")
        self._source = source
        self._first = int(getattr(space, "start", 0))
        self.batched = space is not None
        self.torques: NDArray[np.float64] | None = None
        if hasattr(space, "n") or (space is None and torques is not None):
            given = np.size(np.asarray(torques, object))
            self.torques = checked_grid(torques, int(getattr(space, "n", given)))
        else:
            _require_torque_space(name, space, torques)
        self.discount = _discount(source)
        self.q_values: QFunction | None = None
        network = getattr(source, "q_net", None)  # of Stable-Baselines3's DQN
        if self.torques is not None and network is not None and is_torch_module(network):
            self.q_values = q_function(network, self.torques)

    def __call__(self, observations: NDArray[np.float32]) -> NDArray[np.float64]:
        """Returns the torques in N·m: [B] for observations [B, 3], [] for [3].

        Raises ActionError for an answer that is no action.
        """
        if self.torques is None:
            return torques_of(self._predict, observations)
        answer = self._predict(observations)
        batch = observations.shape[:-1]
        return self.torques[checked_indices(answer, batch, len(self.torques), self._first)]

    def _predict(self, observations: NDArray[np.float32]) -> Any:
        """Returns the action of `predict`'s pair (action, state)."""
        answer = call_agent(self._source.predict, observations, deterministic=True)
        if not isinstance(answer, tuple) or not answer:
            raise ActionError(
                f"predict returned a {name_of(type(answer))}; expected a pair (action, state)"
            )
        return answer[0]


def has_predict(source: Any) -> bool:
    """Returns whether `predict` takes `deterministic`, unlike that of other libraries."""
    try:
        parameters = inspect.signature(source.predict).parameters.values()
    except (AttributeError, TypeError, ValueError):
        return False
    return any(each.name == "deterministic" or each.kind == each.VAR_KEYWORD for each in parameters)


def _require_torque_space(name: str, space: Any, torques: ArrayLike | None) -> None:
    """Raises ConfigError unless the actions are torques from -2 to 2 N·m, without a grid."""
    if torques is not None:
        raise ConfigError(f"torques are given, but {name} chooses no index: {space}")
    bounds: Any = [getattr(space, "low", None), getattr(space, "high", None)]
    if space is not None and not np.array_equal(np.ravel(bounds), [-MAX_TORQUE, MAX_TORQUE]):
        raise ConfigError(
            f"{name} has the actions {space}; expected one torque from -2 to 2 N·m: give a "
            "function that returns the torque"
        )


def _discount(source: Any) -> float | None:
    gamma = getattr(source, "gamma", None)
    try:
        return None if gamma is None else validate_discount(gamma)
    except ConfigError:
        return None
