"""The greedy policy, computed by NumPy from a copy of the weights.

A call into TensorFlow for one observation takes 10 to 100 times as long as this arithmetic.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

# Each function writes into `out`, which is also its input.
ACTIVATIONS: dict[str, Callable[..., Any]] = {
    "tanh": np.tanh,
    "relu": partial(np.maximum, 0),
    "linear": np.positive,
}


def activations_of(activation: str, layers: int) -> list[str]:
    """Returns the activation of each hidden layer: one name for all, or names with commas."""
    names = activation.split(",")
    return names * layers if len(names) == 1 else names


class GreedyPolicy:
    """The greedy policy of fixed weights.

    Args:
        weights: kernel [in, out] and bias [out] of each layer, as `get_weights` returns them.
        activation: of the hidden layers, see `activations_of`.
    """

    def __init__(self, weights: Sequence[NDArray[np.float32]], activation: str) -> None:
        functions = map(ACTIVATIONS.__getitem__, activations_of(activation, len(weights) // 2 - 1))
        self._hidden = list(zip(weights[:-2:2], weights[1:-2:2], functions, strict=True))
        self._head = weights[-2:]

    def q_values(self, observation: NDArray[np.float32]) -> NDArray[np.float32]:
        """Returns the Q-values [A] of an observation [D], or [B, A] of [B, D]."""
        # `dot` and sums in place: for one observation the calls take as long as the arithmetic.
        features = observation
        for kernel, bias, activate in self._hidden:
            features = features.dot(kernel)
            features += bias
            activate(features, out=features)
        kernel, bias = self._head
        q = features.dot(kernel)
        q += bias
        return q

    def action(self, observation: NDArray[np.float32]) -> int:
        """Returns the index of the highest Q-value, the lowest index among equal ones."""
        return int(self.q_values(observation).argmax())


def greedy_policy(network: Any) -> GreedyPolicy:
    """Returns the greedy policy of a DQN's present weights; later updates do not change it."""
    return GreedyPolicy(network.get_weights(), network.activation)  # get_weights returns copies
