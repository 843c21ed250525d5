"""The DQN agent: it selects actions and updates its network, and knows no environment."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

import keras
import numpy as np
import tensorflow as tf
from numpy.typing import NDArray

from keras_pendulum.backend import give_back_freed_memory, keeps_to_one_thread
from keras_pendulum.flat_variables import Arrays, FlatVariables, numbers
from keras_pendulum.network import DQN
from keras_pendulum.policy import GreedyPolicy
from keras_pendulum.q_learning import double_td_target, td_target
from keras_pendulum.randomness import RandomSource
from keras_pendulum.replay import Transitions
from keras_pendulum.target_network import TargetUpdate

# In place of the action taken after an update, see Agent.update_between.
ANY_ACTION, NO_ACTION = -1, -2


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
        # By what they compute and the shapes of what goes in, which stay the same during a run.
        self._compiled: dict[tuple[Any, ...], Callable[..., Any]] = {}
        self._greedy: GreedyPolicy | None = None
        self._thread = ThreadPoolExecutor(1)

    def select_action(
        self, observation: NDArray[np.float32], epsilon: float, known: int | None = None
    ) -> tuple[int, bool]:
        """A random action index with probability ε, else the greedy one of observation [D].

        Args:
            observation: [D].
            epsilon: ε.
            known: the greedy action, where it need not be computed.

        Returns:
            The action, and whether it is a random one.
        """
        if self.random.uniform() <= epsilon:
            return self.random.action(self.online.action_count), True
        return self.policy().action(observation) if known is None else known, False

    def policy(self) -> GreedyPolicy:
        """The greedy policy of the weights since the last update that is finished."""
        if self._greedy is None:
            self._greedy = GreedyPolicy(self.online)
        return self._greedy

    def update(self, batches: Transitions) -> NDArray[np.float32]:
        """Learns from batches [K, B, ...], one after the other; returns the losses [K].

        One compiled call makes all K updates, because a call each costs more than its update.
        """
        (losses,), self._greedy = self._call(self._updates, _packed(batches))
        return losses

    def begin_update(self, batches: Transitions) -> Callable[[], NDArray[np.float32]]:
        """As `update`, on a thread of its own; returns what waits for its end and gives the losses.

        Until that is called, the policy is the one from before. A process that keeps to one thread
        makes the updates then.
        """
        self.policy()
        call = partial(self._call, self._updates, _packed(batches))
        result = call if keeps_to_one_thread() else self._thread.submit(call).result

        def finish() -> NDArray[np.float32]:
            (losses,), self._greedy = result()
            return losses

        return finish

    def update_between(
        self, batches: Transitions, observations: NDArray[np.float32], actions: list[int]
    ) -> NDArray[np.float32]:
        """As `update`, until an update would have changed the action that came after it.

        Args:
            batches: [K, B, ...].
            observations: [K, D], what was observed when update k was due.
            actions: [K], what was done then without that update; ANY_ACTION where it was drawn at
                random; NO_ACTION where nothing was done yet, which makes it the last update.

        Returns:
            The losses of the updates made: up to the first after which the greedy action of its
            observation is not the one in `actions`; all K when there is none.
        """
        rows = _packed(batches)  # [K, B, W]
        acted = np.zeros_like(rows[:, :1])
        acted[:, 0, : observations.shape[-1]] = observations
        acted[:, 0, -1] = actions
        rows = np.concatenate([rows, acted], axis=1)
        (losses, made), self._greedy = self._call(self._updates_between, rows)
        return losses[:made]

    def _call(
        self, compute: Callable[..., Any], rows: NDArray[np.float32]
    ) -> tuple[list[Any], GreedyPolicy]:
        """What `compute` makes of rows, compiled, and the policy of the weights after it."""
        key = (compute, rows.shape)
        first = key not in self._compiled
        if first:
            # Concrete, because a plain tf.function looks through its arguments at each call.
            self._compiled[key] = tf.function(
                lambda rows: (compute(rows), self._variables.joined("online")),
                jit_compile=True,
                autograph=False,
            ).get_concrete_function(tf.TensorSpec(rows.shape))
        found, online = self._compiled[key](tf.constant(rows))
        if first:
            give_back_freed_memory()
        weights = self._variables.split("online", numbers(online))
        return [each.numpy() for each in found], GreedyPolicy(self.online, weights)

    def _updates(self, rows: tf.Tensor) -> tuple[tf.Tensor]:
        losses = tf.scan(
            lambda _, batch: self.learn(batch), _unpacked(rows), initializer=0.0
        )  # [K]
        return (losses,)

    def _updates_between(self, rows: tf.Tensor) -> tuple[tf.Tensor, tf.Tensor]:
        size = self.online.observation_size

        def update(made: tf.Tensor, losses: tf.Tensor, _: tf.Tensor) -> tuple[tf.Tensor, ...]:
            row = rows[made]
            batch, acted = row[:-1], row[-1:]  # [B, W], [1, W]
            loss = self.learn(_unpacked(batch))
            losses = tf.tensor_scatter_nd_update(losses, [[made]], [loss])
            action = tf.cast(acted[0, -1], tf.int64)
            greedy = tf.argmax(self.online(acted[:, :size])[0])
            return made + 1, losses, (action == greedy) | (action == ANY_ACTION)

        made, losses, _ = tf.while_loop(
            lambda made, losses, unchanged: unchanged & (made < rows.shape[0]),
            update,
            (0, tf.zeros(rows.shape[0]), True),
        )
        return losses, made

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

    def close(self) -> None:
        """Ends the thread of `begin_update`."""
        self._thread.shutdown()

    def get_state(self) -> tuple[list[NDArray[Any]], dict[str, Arrays]]:
        """The online weights, and target and optimizer as FlatVariables has them; all read-only."""
        state = self._variables.read()
        return self._variables.split("online", state.pop("online")), state

    def set_state(self, online: list[NDArray[Any]], state: dict[str, Arrays]) -> None:
        """Goes on from what `get_state` gave. Raises ValueError when it does not fit."""
        for name in ("target", "optimizer"):
            self._variables.write(name, state[name])
        self.online.set_weights(online)
        self._greedy = None


def _packed(batches: Transitions) -> NDArray[np.float32]:
    """Batches [K, B, ...] as one array [K, B, W].

    Each array handed to TensorFlow costs a twentieth of an update of CartPole's small network.
    """
    columns = [field.reshape(*batches.reward.shape, -1) for field in batches]
    return np.concatenate(columns, axis=-1, dtype=np.float32)


def _unpacked(rows: tf.Tensor) -> Transitions:
    """The batches [..., B] of `_packed`; float32 holds every index up to 2²⁴ exactly."""
    size = (rows.shape[-1] - 3) // 2
    observation, action, reward, following, terminated = tf.split(rows, [size, 1, 1, size, 1], -1)
    return Transitions(
        observation,
        tf.cast(action[..., 0], tf.int32),
        reward[..., 0],
        following,
        tf.cast(terminated[..., 0], tf.bool),
    )
