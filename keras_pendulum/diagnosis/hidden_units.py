"""Hidden units that hardly learn any more."""

from __future__ import annotations

import numpy as np

from keras_pendulum.diagnosis.measurement import Measurement
from keras_pendulum.dqn.policy import ACTIVATIONS, activations_of
from keras_pendulum.evaluate.q_policies import DQNPolicy


def stuck_units(m: Measurement) -> tuple[float, float]:
    """Returns the shares of saturated tanh outputs and of dead ReLU units, of the worst layer.

    Both are 0 where the policy is not that of a DQN.
    """
    if not isinstance(m.policy, DQNPolicy):
        return 0.0, 0.0
    weights = m.policy.weights
    names = activations_of(m.policy.activation, len(weights) // 2 - 1)
    saturated, dead, features = [0.0], [0.0], m.dynamics.observe(m.states)
    for kernel, bias, name in zip(weights[:-2:2], weights[1:-2:2], names, strict=True):
        features = ACTIVATIONS[name](features @ kernel + bias)
        if name == "tanh":
            saturated.append(float((np.abs(features) > 0.99).mean()))
        elif name == "relu":
            dead.append(float((features.max(axis=0) <= 0).mean()))
    return max(saturated), max(dead)
