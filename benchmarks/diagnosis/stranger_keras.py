"""The network of a small DQN program in plain Keras, with the mistakes of `stranger_programs`."""

from __future__ import annotations

from typing import Any

import keras
import numpy as np
import tensorflow as tf

from benchmarks.diagnosis.stranger_programs import Array, Program


class KerasNetwork:
    """The online and the target network, and Adam."""

    def __init__(self, program: Program) -> None:
        keras.utils.set_random_seed(program.seed)
        self._program = program
        self.online, self._target = self._build(), self._build()
        self.copy()
        self._adam = keras.optimizers.Adam(program.learning_rate)
        self._adam.build(self.online.trainable_variables)
        self._step = tf.function(self._train, reduce_retracing=True)

    def _build(self) -> Any:
        program = self._program
        layers = [keras.layers.Dense(units, program.activation) for units in program.hidden]
        layers.append(keras.layers.Dense(program.torque_count, program.head))
        return keras.Sequential([keras.Input((program.observation_size,)), *layers])

    def q_values(self, observations: Array) -> Array:
        """Returns the values [B, A], by NumPy: a call of Keras takes a thousand times as long."""
        features, weights = observations, self._arrays
        for kernel, bias in zip(weights[:-2:2], weights[1:-2:2], strict=True):
            features = features @ kernel + bias
            features = np.tanh(features) if self._program.activation == "tanh" else features.clip(0)
        return np.asarray(features @ weights[-2] + weights[-1])  # the head changes no order

    def update(self, batch: tuple[Array, ...]) -> None:
        """Makes one step of Adam."""
        self._arrays = [array.numpy() for array in self._step(*map(tf.convert_to_tensor, batch))]

    def _train(self, s: Any, a: Any, r: Any, following: Any, end: Any) -> list[Any]:
        """Returns the new weights, because to read each of them takes as long as the step."""
        program = self._program
        with tf.GradientTape() as tape:
            q = self.online(s)
            chosen = tf.gather(q, a, batch_dims=1)
            if program.through_target:
                target = self._targets(self.online(following), q, a, r, end)
            else:
                target = self._targets(self._target(following), self._target(s), a, r, end)
            if program.loss == "chosen":
                loss = tf.reduce_mean((chosen - target) ** 2)
            elif program.loss == "same-target":
                loss = tf.reduce_mean((q - target[:, None]) ** 2)
            elif program.loss == "zero-others":
                wanted = target[:, None] * tf.one_hot(a, program.torque_count)
                loss = tf.reduce_mean((q - wanted) ** 2)
            else:  # (B, 1) minus (B,) is (B, B)
                loss = tf.reduce_mean((chosen[:, None] - target) ** 2)
        variables = self.online.trainable_variables
        self._adam.apply_gradients(zip(tape.gradient(loss, variables), variables, strict=True))
        return [variable.value for variable in variables]

    def _targets(self, following: Any, same: Any, a: Any, r: Any, end: Any) -> Any:
        values = {
            "max": lambda: tf.reduce_max(following, 1),
            "mean": lambda: tf.reduce_mean(following, 1),
            "min": lambda: tf.reduce_min(following, 1),
            "first": lambda: following[:, 0],
            "last": lambda: following[:, -1],
            "same-action": lambda: tf.gather(following, a, batch_dims=1),
            "negative": lambda: -tf.reduce_max(following, 1),
            "batch-max": lambda: tf.reduce_max(following),
            "index": lambda: tf.cast(tf.argmax(following, 1), tf.float32),
            "same-state": lambda: tf.reduce_max(same, 1),
            "none": lambda: tf.zeros_like(r),
        }
        return r + self._program.discount * (1 - end) * values[self._program.target]()

    def copy(self) -> None:
        """Copies the weights to the target network."""
        self._target.set_weights(self.online.get_weights())
        self._arrays = self.online.get_weights()

    def weights(self) -> list[Array]:
        """Returns kernel [in, out] and bias of each layer."""
        return list(self.online.get_weights())
