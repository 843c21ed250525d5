"""The Q-network: observations in, one value for each action out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import keras

_DTYPE = "float32"  # whatever the user's keras.json says


@dataclass(frozen=True)
class Origin:
    """Where a network's weights come from, as far as its file tells."""

    environment: str = "Pendulum-v1"
    gravity: float | None = None  # m/s²
    preset: str | None = None
    seed: int | None = None
    config: str | None = None  # the settings of its run, as JSON


class DQN(keras.Model):
    """The originals' network: Dense layers, then one linear output for each action.

    It is built when it is made, so that no weights can be copied into or out of it before they
    exist. Initial weights follow from `seed` alone: `glorot`, uniform within
    ±√(6 / (inputs + outputs)) with biases 0, or `fan-in`, uniform within ±1/√inputs, biases too.
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
        origin: Origin | None = None,
    ) -> None:
        super().__init__(dtype=_DTYPE)
        self.hidden_units = tuple(hidden_units)
        self.action_count = action_count
        self.observation_size = observation_size
        self.activation = activation
        self.origin = origin or Origin()
        seeds = keras.random.SeedGenerator(seed)

        def dense(inputs: int, units: int, activation: str | None) -> keras.layers.Dense:
            kernel: Any = keras.initializers.GlorotUniform(seed=seeds)
            bias: Any = "zeros"
            if initial_weights == "fan-in":
                limit = inputs**-0.5
                kernel = keras.initializers.RandomUniform(-limit, limit, seed=seeds)
                bias = keras.initializers.RandomUniform(-limit, limit, seed=seeds)
            return keras.layers.Dense(
                units,
                activation,
                kernel_initializer=kernel,
                bias_initializer=bias,
                dtype=_DTYPE,
            )

        widths = (observation_size, *hidden_units)
        self.hidden = [dense(inputs, units, activation) for inputs, units in pairwise(widths)]
        self.head = dense(widths[-1], action_count, None)
        self.build((None, observation_size))

    def build(self, input_shape: tuple[int | None, int]) -> None:
        """Makes the weights, once. `input_shape` is (None, observation size)."""
        for layer in (*self.hidden, self.head):
            if not layer.built:
                layer.build(input_shape)
            input_shape = (None, layer.units)
        self.built = True

    def call(self, observation: Any) -> Any:
        """Q-values [B, A] of observations [B, D] (what they hold: environment.py)."""
        features = observation
        for layer in self.hidden:
            features = layer(features)
        return self.head(features)

    def twin(self) -> DQN:
        """A second network of the same shape and weights that shares nothing with this one."""
        copy = DQN(
            self.hidden_units,
            self.action_count,
            observation_size=self.observation_size,
            activation=self.activation,
            origin=self.origin,
        )
        copy.set_weights(self.get_weights())
        return copy
