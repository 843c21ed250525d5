"""The target network: the rules that make TD targets with it, and those that update it."""

from __future__ import annotations

from collections.abc import Callable

import tensorflow as tf

from keras_pendulum.dqn.losses import double_td_target, td_target
from keras_pendulum.dqn.network import DQN
from keras_pendulum.dqn.replay_buffer import Transitions

# Returns the TD targets [B] from the online network, the target network, a batch [B, ...] and γ.
TargetRule = Callable[[DQN, DQN, Transitions, float], tf.Tensor]
# Called after each gradient step with the online network, the target network and the number of
# gradient steps so far, an integer tensor. `partial` makes one of `soft_update` or `hard_update`.
TargetUpdate = Callable[[DQN, DQN, tf.Tensor], None]


def q_learning(online: DQN, target: DQN, batch: Transitions, discount: float) -> tf.Tensor:
    """Returns the TD targets [B] with next actions that `target` chooses and values."""
    next_q = target(batch.next_observation)  # [B, A]
    return td_target(batch.reward, batch.terminated, next_q, discount)


def double_q_learning(online: DQN, target: DQN, batch: Transitions, discount: float) -> tf.Tensor:
    """Returns the TD targets [B] with next actions that `online` chooses and `target` values."""
    next_q = target(batch.next_observation)  # [B, A]
    next_q_online = online(batch.next_observation)  # [B, A]
    return double_td_target(batch.reward, batch.terminated, next_q, next_q_online, discount)


def soft_update(tau: float, online: DQN, target: DQN, steps: tf.Tensor) -> None:
    """Moves target ← tau·online + (1 - tau)·target (Lillicrap et al. 2016, algorithm 1)."""
    for source, destination in zip(online.weights, target.weights, strict=True):
        destination.assign(tau * source + (1.0 - tau) * destination)


def hard_update(period: int, online: DQN, target: DQN, steps: tf.Tensor) -> None:
    """Copies target ← online at every `period`-th gradient step (Mnih et al. 2015)."""
    due = tf.equal(steps % period, 0)
    for source, destination in zip(online.weights, target.weights, strict=True):
        destination.assign(tf.where(due, source, destination))


def no_update(online: DQN, target: DQN, steps: tf.Tensor) -> None:
    """Does nothing: the online network is its own target, the original's `no-target-network`."""
