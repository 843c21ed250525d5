"""The DQN agent: it selects actions and updates its network, and knows no environment."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import keras
import numpy as np
import tensorflow as tf
from numpy.typing import NDArray

from keras_pendulum.backend import give_back_freed_memory
from keras_pendulum.flat_variables import Arrays, FlatVariables
from keras_pendulum.network import DQN
from keras_pendulum.policy import GreedyPolicy
from keras_pendulum.q_learning import double_td_target, td_target
from keras_pendulum.randomness import RandomSource
from keras_pendulum.replay import Transitions
from keras_pendulum.target_network import TargetUpdate

_NOTHING = np.empty(0, np.float32)  # in place of an observation


class Agent:
    """ε-greedy behaviour and the update of Mnih et al. 2015, over networks handed in.

    Args:
        online: the network that acts and learns.
        target: the network that values the next observations.
        update_target: how `target` follows `online` after each update.
        optimizer: a Keras optimizer for the online network.
        loss: of Q-values [B, A], actions [B] and targets [B], a scalar.
        discount: γ.
        double_q: whether `online` chooses the next action that `target` values.
        random: source of the exploration draws.
    """

    def __init__(
        self,
        online: DQN,
        target: DQN,
        update_target: TargetUpdate,
        optimizer: keras.optimizers.Optimizer,
        loss: Callable[[tf.Tensor, tf.Tensor, tf.Tensor], tf.Tensor],
        discount: float,
        double_q: bool,
        random: RandomSource,
    ) -> None:
        self.online = online
        self.target = target
        self.update_target = update_target
        self.optimizer = optimizer
        self.loss = loss
        self.discount = discount
        self.double_q = double_q
        self.random = random
        optimizer.build(online.trainable_variables)
        self._variables = FlatVariables(
            online=online.weights, target=target.weights, optimizer=optimizer.variables
        )
        # By the shapes of what goes in, which stay the same during a run.
        self._compiled: dict[tuple[int, ...], Callable[..., tuple[tf.Tensor, Any]]] = {}
        # What there is to act on since the last update: copies of the weights, or one observation
        # with its Q-values [A].
        self._greedy: GreedyPolicy | None = None
        self._valued: tuple[NDArray[np.float32], NDArray[np.float32]] | None = None

    def select_action(self, observation: NDArray[np.float32], epsilon: float) -> int:
        """A random action index with probability ε, else the greedy one of observation [D]."""
        if self.random.uniform() <= epsilon:
            return self.random.action(self.online.action_count)
        if self._valued is not None and self._valued[0] is observation:
            return int(self._valued[1].argmax())
        return self.policy().action(observation)

    def policy(self) -> GreedyPolicy:
        """The greedy policy of the weights since the last update."""
        if self._greedy is None:
            self._greedy = GreedyPolicy(self.online)
        return self._greedy

    def update(
        self, batches: Transitions, observation: NDArray[np.float32] | None = None
    ) -> NDArray[np.float32]:
        """Learns from batches [K, B, ...], one after the other; returns the losses [K].

        One compiled call makes all K updates, because a call each costs more than its update. It
        also gives what to act on next: the weights, or the values of `observation` [D], where an
        update comes after each step and a copy of the weights would be for a single use.
        """
        rows = _packed(batches)
        valued = _NOTHING if observation is None else observation
        shapes = (*rows.shape, *valued.shape)
        first = shapes not in self._compiled
        if first:
            # Concrete, because a plain tf.function looks through its arguments at each call.
            function = tf.function(self._updates, jit_compile=True, autograph=False)
            self._compiled[shapes] = function.get_concrete_function(
                tf.TensorSpec(rows.shape), tf.TensorSpec(valued.shape)
            )
        losses, found = self._compiled[shapes](tf.constant(rows), tf.constant(valued))
        if first:
            give_back_freed_memory()
        self._greedy = self._valued = None
        if observation is None:
            self._greedy = GreedyPolicy(self.online, [each.numpy() for each in found])
        else:
            self._valued = (observation, found.numpy())
        return losses.numpy()

    def _updates(self, rows: tf.Tensor, observation: tf.Tensor) -> tuple[tf.Tensor, Any]:
        batches = _unpacked(rows)
        losses = tf.scan(lambda _, batch: self.learn(batch), batches, initializer=0.0)  # [K]
        if observation.shape == _NOTHING.shape:
            # Reading them in calls of their own takes as long as an update.
            return losses, [each.value.read_value() for each in self.online.weights]
        return losses, self.online(observation[tf.newaxis])[0]  # [K], [A]

    def learn(self, batch: Transitions) -> tf.Tensor:
        """One update from a batch [B, ...]; returns its loss, a scalar."""
        next_q = self.target(batch.next_observation)  # [B, A]
        outcome = (batch.reward, batch.terminated, next_q)
        if self.double_q:
            next_q_online = self.online(batch.next_observation)  # [B, A]
            target = double_td_target(*outcome, next_q_online, self.discount)  # [B]
        else:
            target = td_target(*outcome, self.discount)  # [B]
        with tf.GradientTape() as tape:
            q = self.online(batch.observation)  # [B, A]
            loss = self.loss(q, batch.action, target)
        variables = self.online.trainable_variables
        gradients = tape.gradient(loss, variables)
        self.optimizer.apply_gradients(zip(gradients, variables, strict=True))
        self.update_target(self.online, self.target, self.optimizer.iterations)
        return loss

    def get_state(self) -> tuple[list[NDArray[Any]], dict[str, Arrays]]:
        """The online weights, and target and optimizer as FlatVariables has them; all read-only."""
        state = self._variables.read()
        return self._variables.split("online", state.pop("online")), state

    def set_state(self, online: list[NDArray[Any]], state: dict[str, Arrays]) -> None:
        """Goes on from what `get_state` gave. Raises ValueError when it does not fit."""
        for name in ("target", "optimizer"):
            self._variables.write(name, state[name])
        self.online.set_weights(online)
        self._greedy = self._valued = None


def _packed(batches: Transitions) -> NDArray[np.float32]:
    """Batches [K, B, ...] as one array [K, B, W].

    Each array handed to TensorFlow costs a twentieth of an update of CartPole's small network.
    """
    columns = [field.reshape(*batches.reward.shape, -1) for field in batches]
    return np.concatenate(columns, axis=-1, dtype=np.float32)


def _unpacked(rows: tf.Tensor) -> Transitions:
    """The batches [K, B, ...] of `_packed`; float32 holds every index up to 2²⁴ exactly."""
    size = (rows.shape[-1] - 3) // 2
    observation, action, reward, following, terminated = tf.split(rows, [size, 1, 1, size, 1], -1)
    return Transitions(
        observation,
        tf.cast(action[..., 0], tf.int32),
        reward[..., 0],
        following,
        tf.cast(terminated[..., 0], tf.bool),
    )
