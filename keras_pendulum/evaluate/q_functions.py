"""Functions from observations to Q-values, whichever library computes them."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from keras_pendulum.environments.actions import MAX_TORQUE
from keras_pendulum.errors import ConfigError
from keras_pendulum.evaluate.answers import EXAMPLES, checked_values, name_of


@dataclass(frozen=True)
class QFunction:
    """A function with the torques that its outputs stand for; `q_function` makes one."""

    function: Callable[[Any], Any]
    torques: NDArray[np.float64]  # [A] N·m
    name: str

    def __call__(self, observations: NDArray[np.float32]) -> NDArray[Any]:
        """Returns the Q-values [B, A] of observations [B, 3].

        Raises ActionError when the function raises an exception or returns anything else.
        """
        return checked_values(self.function, observations, len(self.torques))


def q_function(
    function: Callable[[Any], Any], torques: ArrayLike | None = None, name: str | None = None
) -> QFunction:
    """Returns an agent for `evaluate_policy` from a function of Q-values.

    Args:
        function: gets observations, float32 [B, 3], as a NumPy array, and returns Q-values [B, A]
            as an array of NumPy, PyTorch, TensorFlow or JAX. A `torch.nn.Module` gets a tensor on
            its own device, in its evaluation mode and without gradients.
        torques: N·m, one for each output, -2 to 2; None takes `linspace(-2, 2, A)`.
        name: for messages; None takes the function's.

    Raises ConfigError for wrong torques. Raises UserError when the function cannot be called so, or
    returns anything else.

    >>> agent = kp.q_function(lambda observations: observations, torques=[-2, 0, 2])
    >>> kp.evaluate_policy(agent, episodes=1).regret > 100
    True
    """
    if not callable(function):
        raise TypeError(f"function is {function!r}; expected a function of observations")
    call = _torch_call(function) if is_torch_module(function) else function
    count = checked_values(call, EXAMPLES).shape[1]
    return QFunction(call, checked_grid(torques, count), name or name_of(function))


def is_torch_module(value: object) -> bool:
    """Returns whether the value is a `torch.nn.Module`; PyTorch is not imported for it."""
    torch = sys.modules.get("torch")
    return torch is not None and isinstance(value, torch.nn.Module)


def checked_grid(torques: ArrayLike | None, count: int) -> NDArray[np.float64]:
    """Returns the torques [A] in N·m of `count` actions; None stands for `linspace(-2, 2, A)`.

    Raises ConfigError unless they are `count` numbers from -2 to 2.
    """
    if torques is None:
        return np.linspace(-MAX_TORQUE, MAX_TORQUE, count)
    try:
        grid = np.asarray(torques)
    except ValueError:  # lists of several lengths
        grid = np.empty(0, object)
    if grid.dtype.kind not in "fiu" or grid.ndim != 1:
        raise ConfigError(f"torques are {torques!r}; expected a list of numbers (N·m)")
    if not (np.abs(grid) <= MAX_TORQUE).all():  # written so that NaN fails too
        raise ConfigError(f"torques are {torques!r}; expected numbers from -2 to 2 (N·m)")
    if len(grid) != count:
        raise ConfigError(f"torques has {len(grid)} numbers; the agent has {count} actions")
    return grid.astype(np.float64)


def _torch_call(module: Any) -> Callable[[NDArray[np.float32]], Any]:
    """Returns a function that calls a PyTorch module and leaves its modes as they were."""
    import torch

    weights = next(module.parameters(), None)
    device = "cpu" if weights is None else weights.device
    dtype = torch.float32 if weights is None else weights.dtype

    def call(observations: NDArray[np.float32]) -> Any:
        modes = [(part, part.training) for part in module.modules()]
        module.eval()
        try:
            with torch.no_grad():
                return module(torch.tensor(observations, dtype=dtype, device=device))
        finally:
            for part, training in modes:
                part.training = training

    return call
