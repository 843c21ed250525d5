"""The DQN agent: it selects actions and updates its network."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import keras
import numpy as np
import tensorflow as tf
from numpy.typing import NDArray

from keras_pendulum.dqn.network import DQN
from keras_pendulum.dqn.policy import GreedyPolicy, greedy_policy
from keras_pendulum.dqn.replay_buffer import Transitions
from keras_pendulum.dqn.target_network import TargetRule, TargetUpdate

Variables = dict[str, NDArray[Any]]  # values by the variables' paths


@dataclass(eq=False)
class Agent:
    """ε-greedy behaviour policy and the update of Mnih et al. 2015."""

    online: DQN  # the network that acts and learns
    target: DQN  # the network that values the next observations
    target_rule: TargetRule  # makes the TD targets
    update_target: TargetUpdate  # changes `target` after each gradient step
    optimizer: keras.optimizers.Optimizer  # for `online`
    # Returns a scalar from Q-values [B, A], actions [B] and TD targets [B].
    loss: Callable[[tf.Tensor, tf.Tensor, tf.Tensor], tf.Tensor]
    discount: float  # γ
    rng: np.random.RandomState  # random-number generator of the exploration

    def __post_init__(self) -> None:
        self.policy = greedy_policy(self.online)
        self.optimizer.build(self.online.trainable_variables)
        self._compiled: dict[tuple[int, ...], Callable[..., Any]] = {}  # by the batches' shape

    def select_action(self, observation: NDArray[np.float32], epsilon: float) -> int:
        """Returns a random action with probability ε, else the greedy one of observation [D]."""
        if self.rng.random_sample() <= epsilon:
            return int(self.rng.randint(self.online.action_count))
        return self.policy.action(observation)

    def is_compiled(self, batches: Transitions) -> bool:
        """Returns false where `update` must compile first, which takes about a second."""
        return batches.action.shape in self._compiled

    def update(self, batches: Transitions) -> NDArray[np.float32]:
        """Makes one gradient step for each of the batches [K, B, ...]; returns the losses [K].

        All K steps run in one compiled call, because a call costs more than a step.
        """
        tensors = [tf.constant(field) for field in batches]
        if not self.is_compiled(batches):
            # A concrete function, because a plain tf.function checks its arguments at each call.
            steps = tf.function(self._gradient_steps, jit_compile=True, autograph=False)
            self._compiled[batches.action.shape] = steps.get_concrete_function(*tensors)
        losses, weights = self._compiled[batches.action.shape](*tensors)
        self.policy = GreedyPolicy([each.numpy() for each in weights], self.online.activation)
        return losses.numpy()

    def _gradient_steps(self, *fields: tf.Tensor) -> tuple[tf.Tensor, list[tf.Tensor]]:
        """Makes the gradient steps of `update`; returns the losses [K] and the online weights."""
        batches = Transitions(*fields)  # [K, B, ...]
        losses = tf.scan(lambda _, batch: self.gradient_step(batch), batches, initializer=0.0)
        return losses, [variable.value for variable in self.online.weights]

    def gradient_step(self, batch: Transitions) -> tf.Tensor:
        """Makes one gradient step from a batch [B, ...]; returns its loss, a scalar."""
        target = self.target_rule(self.online, self.target, batch, self.discount)  # [B]
        with tf.GradientTape() as tape:
            q = self.online(batch.observation)  # [B, A]
            loss = self.loss(q, batch.action, target)
        variables = self.online.trainable_variables
        gradients = tape.gradient(loss, variables)
        self.optimizer.apply_gradients(zip(gradients, variables, strict=True))
        self.update_target(self.online, self.target, self.optimizer.iterations)
        return loss

    def average_weights(self) -> None:
        """Replaces the online weights by the optimizer's moving average, without its beginning."""
        if self.optimizer.ema_momentum ** int(self.optimizer.iterations) < 1e-3:
            self.optimizer.finalize_variable_values(self.online.trainable_variables)
            self.policy = greedy_policy(self.online)

    def get_state(self) -> dict[str, Variables]:
        """Returns copies of the variables of `online`, `target` and `optimizer`."""
        return {
            group: {variable.path: np.asarray(variable.numpy()) for variable in variables}
            for group, variables in self._groups().items()
        }

    def set_state(self, state: dict[str, Variables]) -> None:
        """Restores a state of `get_state`.

        Raises ValueError, and changes nothing, when the variables have other paths or shapes.
        """
        groups = self._groups()
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
        return {
            "online": self.online.weights,
            "target": self.target.weights,
            "optimizer": self.optimizer.variables,
        }
