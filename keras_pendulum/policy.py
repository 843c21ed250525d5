"""Acting with a network: a NumPy copy of its weights.

One observation is so little work that any call into TensorFlow costs many times more.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray


def _relu(features: NDArray[np.float32], out: NDArray[np.float32]) -> None:
    np.maximum(features, 0, out=out)


ACTIVATIONS: dict[str, Callable[..., Any]] = {"tanh": np.tanh, "relu": _relu}


class GreedyPolicy:
    """The greedy policy of a network's weights as they are now; later changes do not reach it.

    Args:
        network: a DQN.
        weights: copies of its weights, where they are at hand.
    """

    def __init__(self, network: Any, weights: list[NDArray[np.float32]] | None = None) -> None:
        # get_weights hands out copies.
        weights = weights or network.get_weights()
        self._hidden = list(zip(weights[:-2:2], weights[1:-2:2], strict=True))
        self._head = weights[-2:]
        self._activate = ACTIVATIONS[network.activation]

    def q_values(self, observation: NDArray[np.float32]) -> NDArray[np.float32]:
        """Q-values [A] of an observation [D], or [B, A] of [B, D]."""
        # `dot` and sums in place, because for one observation the calls cost as much as the work.
        features = observation
        for kernel, bias in self._hidden:
            features = features.dot(kernel)
            features += bias
            self._activate(features, out=features)
        kernel, bias = self._head
        q = features.dot(kernel)
        q += bias
        return q

    def action(self, observation: NDArray[np.float32]) -> int:
        """The index of the action with the highest value; the lowest index among equals."""
        return int(self.q_values(observation).argmax())
