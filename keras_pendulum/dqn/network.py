"""The Q-network: observations in, one value per action out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from functools import partial
from itertools import pairwise
from typing import Any

import keras

from keras_pendulum.dqn.policy import activations_of

REGISTERED_NAME = "keras_pendulum>DQN"  # in the files of Keras
_SPREAD = 0.3  # limit of the hidden biases of `spread`
_DTYPE = "float32"  # also where the user's keras.json names another one


@dataclass(frozen=True)
class Provenance:
    """The run that a network comes from, as far as its file records it."""

    environment: str = "Pendulum-v1"
    gravity: float | None = None  # m/s²
    preset: str | None = None
    seed: int | None = None
    config: str | None = None  # the settings of the run, as JSON


@keras.saving.register_keras_serializable("keras_pendulum")
class DQN(keras.Model):
    """Dense layers with an activation, then a linear output for each action.

    `activation` is one name for all hidden layers, or one for each, separated by commas. The
    constructor builds the weights. They depend on `seed` alone and are uniform. `glorot`: within
    ±√(6 / (inputs + outputs)), biases 0. `fan-in`: within ±1/√inputs, biases too. `spread`: as
    `glorot`, but the first kernel within ±1/√inputs and the hidden biases within ±0.3.
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
        provenance: Provenance | None = None,
    ) -> None:
        super().__init__(name="dqn", dtype=_DTYPE)
        self.hidden_units = tuple(hidden_units)
        self.action_count = action_count
        self.observation_size = observation_size
        self.activation = activation
        self.provenance = provenance or Provenance()
        seeds = keras.random.SeedGenerator(seed)

        def dense(name: str, inputs: int, units: int, activation: str | None) -> keras.layers.Dense:
            layer = partial(keras.layers.Dense, units, activation, name=name, dtype=_DTYPE)

            def uniform(limit: float) -> keras.initializers.Initializer:
                return keras.initializers.RandomUniform(-limit, limit, seed=seeds)

            fan_in = uniform(inputs**-0.5)
            if initial_weights == "fan-in":
                return layer(kernel_initializer=fan_in, bias_initializer=fan_in)
            glorot = keras.initializers.GlorotUniform(seed=seeds)
            if initial_weights == "glorot" or name == "head":
                return layer(kernel_initializer=glorot)
            kernel = fan_in if name == "hidden_0" else glorot
            return layer(kernel_initializer=kernel, bias_initializer=uniform(_SPREAD))

        widths = (observation_size, *hidden_units)
        names = activations_of(activation, len(self.hidden_units))
        self.hidden = [
            dense(f"hidden_{i}", inputs, units, name)
            for i, ((inputs, units), name) in enumerate(zip(pairwise(widths), names, strict=True))
        ]
        self.head = dense("head", widths[-1], action_count, None)
        self.build((None, observation_size))

    def build(self, input_shape: tuple[int | None, int]) -> None:
        """Creates the weights, once. `input_shape` is (None, D)."""
        for layer in (*self.hidden, self.head):
            if not layer.built:
                layer.build(input_shape)
            input_shape = (None, layer.units)
        self.built = self._called = True  # Keras exports no model before its first call

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
        names = ("hidden_units", "action_count", "observation_size", "activation")
        return {name: getattr(self, name) for name in names} | asdict(self.provenance)

    @classmethod
    def from_config(cls, config: dict[str, Any]) -> DQN:
        """Returns a network with new weights."""
        run = Provenance(*(config[field.name] for field in fields(Provenance)))
        return cls(**{key: config[key] for key in config.keys() - vars(run)}, provenance=run)
