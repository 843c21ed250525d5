"""The Q-network: observations in, one value per action out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import keras

from keras_pendulum.dqn.policy import activations_of

REGISTERED_NAME = "keras_pendulum>DQN"  # in the files of Keras
_SPREAD = 0.3  # limit of the hidden biases of `spread`
_DTYPE = "float32"  # also where the user's keras.json names another one
_SIZES = ("hidden_units", "action_count", "observation_size", "activation")


@keras.saving.register_keras_serializable("keras_pendulum")
class DQN(keras.Model):
    """Dense layers with an activation, then a linear output for each action.

    `activation` is one name for all hidden layers, or one for each, separated by commas. The
    constructor builds the weights. They depend on `seed` alone and are uniform. `glorot`: within
    ±√(6 / (inputs + outputs)), biases 0. `fan-in`: within ±1/√inputs, biases too. `spread`: as
    `glorot`, but the first kernel within ±1/√inputs and the hidden biases within ±0.3.

    `metadata` holds JSON values by name, such as the task of a run. Copies and files keep it.
    """

    def __init__(
        self,
        hidden_units: Sequence[int] = (512, 256, 128),
        action_count: int = 41,
        *,
        observation_size: int = 3,
        activation: str = "tanh",
        initial_weights: str = "glorot",
        seed: int = 0,
        metadata: Mapping[str, Any] | None = None,
    ) -> None:
        super().__init__(name="dqn", dtype=_DTYPE)
        self.hidden_units = tuple(hidden_units)
        self.action_count = action_count
        self.observation_size = observation_size
        self.activation = activation
        self.metadata = dict(metadata or {})
        seeds = keras.random.SeedGenerator(seed)

        def uniform(limit: float) -> keras.initializers.Initializer:
            return keras.initializers.RandomUniform(-limit, limit, seed=seeds)

        widths = (observation_size, *hidden_units, action_count)
        names = [*activations_of(activation, len(self.hidden_units)), None]
        layers = []
        for i, ((inputs, units), name) in enumerate(zip(pairwise(widths), names, strict=True)):
            kernel, bias = keras.initializers.GlorotUniform(seed=seeds), "zeros"
            if initial_weights == "fan-in":
                kernel = bias = uniform(inputs**-0.5)
            elif initial_weights == "spread" and name is not None:
                kernel = uniform(inputs**-0.5) if i == 0 else kernel
                bias = uniform(_SPREAD)
            layer = keras.layers.Dense(
                units,
                name,
                kernel_initializer=kernel,
                bias_initializer=bias,
                name="head" if name is None else f"hidden_{i}",
                dtype=_DTYPE,
            )
            with keras.name_scope(self.name):  # a part of the variables' paths
                layer.build((None, inputs))
            layers.append(layer)
        *self.hidden, self.head = layers
        self(keras.ops.zeros((1, observation_size)))  # Keras exports no model before its first call

    def call(self, observation: Any) -> Any:
        """Returns the Q-values [B, A] of observations [B, D]."""
        features = observation
        for layer in self.hidden:
            features = layer(features)  # [B, units]
        return self.head(features)

    def clone(self) -> DQN:
        """Returns a network with the same weights and its own variables."""
        copy = DQN.from_config(self.get_config())
        copy.set_weights(self.get_weights())
        return copy

    def get_config(self) -> dict[str, Any]:
        """Returns the arguments for `from_config`; Keras copies and saves networks with both."""
        return {name: getattr(self, name) for name in _SIZES} | self.metadata

    @classmethod
    def from_config(cls, config: dict[str, Any]) -> DQN:
        """Returns a network with new weights."""
        sizes = {name: config[name] for name in _SIZES}
        metadata = {name: config[name] for name in config if name not in _SIZES}
        return cls(**sizes, metadata=metadata)
