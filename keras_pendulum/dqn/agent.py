"""The DQN agent: it selects actions and updates its network."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import keras
import numpy as np
import tensorflow as tf
from numpy.typing import NDArray

from keras_pendulum.dqn.losses import double_td_target, td_target
from keras_pendulum.dqn.network import DQN
from keras_pendulum.dqn.policy import GreedyPolicy, greedy_policy
from keras_pendulum.dqn.replay_buffer import Transitions
from keras_pendulum.dqn.target_network import TargetUpdate

Variables = dict[str, NDArray[Any]]  # values by the variables' paths


@dataclass(eq=False)
class Agent:
    """ε-greedy behaviour policy and the update of Mnih et al. 2015."""

    online: DQN  # the network that acts and learns
    target: DQN  # the network that values the next observations
    update_target: TargetUpdate  # changes `target` after each gradient step
    optimizer: keras.optimizers.Optimizer  # for `online`
    # Returns a scalar from Q-values [B, A], actions [B] and TD targets [B].
    loss: Callable[[tf.Tensor, tf.Tensor, tf.Tensor], tf.Tensor]
    discount: float  # γ
    double_q: bool  # true where `online` chooses the next action that `target` values
    rng: np.random.RandomState  # random-number generator of the exploration

    def __post_init__(self) -> None:
        self.policy = greedy_policy(self.online)
        self.optimizer.build(self.online.trainable_variables)
        self._compiled: dict[tuple[int, ...], Callable[..., Any]] = {}  # by the batches' shape
        # Called before a compilation, which takes about a second.
        self.on_compile: Callable[[], object] = lambda: None

    def select_action(self, observation: NDArray[np.float32], epsilon: float) -> int:
        """Returns a random action with probability ε, else the greedy one of observation [D]."""
        if self.rng.random_sample() <= epsilon:
            return int(self.rng.randint(self.online.action_count))
        return self.policy.action(observation)

    def update(self, batches: Transitions) -> NDArray[np.float32]:
        """Makes one gradient step for each of the batches [K, B, ...]; returns the losses [K].

        All K steps run in one compiled call, because a call costs more than a step.
        """
        tensors = [tf.constant(field) for field in batches]
        shape = batches.action.shape
        if shape not in self._compiled:
            self.on_compile()
            # A concrete function, because a plain tf.function checks its arguments at each call.
            steps = tf.function(self._gradient_steps, jit_compile=True, autograph=False)
            self._compiled[shape] = steps.get_concrete_function(*tensors)
        losses, weights = self._compiled[shape](*tensors)
        self.policy = GreedyPolicy([each.numpy() for each in weights], self.online.activation)
        return losses.numpy()

    def _gradient_steps(self, *fields: tf.Tensor) -> tuple[tf.Tensor, list[tf.Tensor]]:
        """Makes the gradient steps of `update`; returns the losses [K] and the online weights."""
        batches = Transitions(*fields)  # [K, B, ...]
        losses = tf.scan(lambda _, batch: self.gradient_step(batch), batches, initializer=0.0)
        return losses, [variable.value for variable in self.online.weights]

    def gradient_step(self, batch: Transitions) -> tf.Tensor:
        """Makes one gradient step from a batch [B, ...]; returns its loss, a scalar."""
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

    def average_weights(self) -> None:
        """Replaces the online weights by their moving average, if the optimizer has one."""
        if self.optimizer.iterations > 0:  # the average begins with the first update
            self.optimizer.finalize_variable_values(self.online.trainable_variables)
            self.policy = greedy_policy(self.online)

    def get_state(self) -> dict[str, Variables]:
        """Returns copies of the variables of `target` and `optimizer`, by their paths.

        The online weights are not among them: a checkpoint holds them as Keras's layers.
        """
        return {
            group: {variable.path: np.asarray(variable.numpy()) for variable in variables}
            for group, variables in self._groups().items()
        }

    def set_state(self, weights: list[NDArray[np.float32]], state: dict[str, Variables]) -> None:
        """Restores the online weights and a state of `get_state`.

        Raises ValueError, and changes nothing, when the variables have other paths or shapes.
        """
        groups = {**self._groups(), "online": self.online.weights}
        paths = [variable.path for variable in groups["online"]]
        state = {**state, "online": dict(zip(paths, weights, strict=True))}
        for group, variables in groups.items():
            expected = {variable.path: tuple(variable.shape) for variable in variables}
            found = {path: array.shape for path, array in state.get(group, {}).items()}
            if wrong := sorted(path for path, _ in expected.items() ^ found.items()):
                raise ValueError(f"{group}/{wrong[0]} is missing, unknown or of another shape")
        for group, variables in groups.items():
            for variable in variables:
                variable.assign(state[group][variable.path])
        self.policy = greedy_policy(self.online)

    def _groups(self) -> dict[str, list[keras.Variable]]:
        return {"target": self.target.weights, "optimizer": self.optimizer.variables}
