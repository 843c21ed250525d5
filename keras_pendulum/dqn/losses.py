"""The TD target and the losses of Q-learning, as pure functions of tensors.

tests/torch/torch_agent.py has a PyTorch twin of each.
"""

from __future__ import annotations

import tensorflow as tf


def td_target(
    reward: tf.Tensor, terminated: tf.Tensor, next_q: tf.Tensor, discount: float
) -> tf.Tensor:
    """Returns the TD target r + γ·max Q(next); after termination it is r.

    Source: Mnih et al. 2015, Methods, "Training algorithm for deep Q-networks".

    Args:
        reward: [B] float32.
        terminated: [B] bool.
        next_q: [B, A] float32, the target network's values of the next observations.
        discount: γ.

    Returns:
        [B] float32. No gradient flows through it.
    """
    bootstrap = tf.where(terminated, 0.0, discount * tf.reduce_max(next_q, axis=1))  # [B]
    return tf.stop_gradient(reward + bootstrap)


def double_td_target(
    reward: tf.Tensor,
    terminated: tf.Tensor,
    next_q: tf.Tensor,
    next_q_online: tf.Tensor,
    discount: float,
) -> tf.Tensor:
    """Returns the TD target with the next action chosen by the online network.

    The maximum of noisy values is too high on average. Two networks seldom overestimate the same
    action. Source: van Hasselt et al. 2016, section "Double DQN".

    Args:
        reward: [B] float32.
        terminated: [B] bool.
        next_q: [B, A] float32, the target network's values of the next observations.
        next_q_online: [B, A] float32, the online network's values of them.
        discount: γ.

    Returns:
        [B] float32. No gradient flows through it.
    """
    next_action = tf.argmax(next_q_online, axis=1)  # [B]
    value = tf.gather(next_q, next_action, batch_dims=1)  # [B]
    return tf.stop_gradient(reward + tf.where(terminated, 0.0, discount * value))


def mean_squared_error(q: tf.Tensor, action: tf.Tensor, target: tf.Tensor) -> tf.Tensor:
    """Returns the original's loss: the squared TD error, averaged over all B·A outputs.

    Each output of an action that was not taken is its own target. So the loss equals the mean
    squared TD error of the taken actions, divided by A.

    Args:
        q: [B, A] float32, the online network's values.
        action: [B] int32.
        target: [B] float32.

    Returns:
        scalar float32.
    """
    taken = tf.one_hot(action, q.shape[1], on_value=True, off_value=False)  # [B, A]
    target_q = tf.where(taken, target[:, tf.newaxis], tf.stop_gradient(q))  # [B, A]
    return tf.reduce_mean(tf.square(target_q - q))


def huber(q: tf.Tensor, action: tf.Tensor, target: tf.Tensor) -> tf.Tensor:
    """Returns the notebooks' loss: the Huber loss of the taken actions, δ = 1, batch mean.

    It is half the square of a TD error up to 1, and its absolute value minus 1/2 beyond. Source:
    Mnih et al. 2015, Methods, on clipping the error.

    Args:
        q: [B, A] float32, the online network's values.
        action: [B] int32.
        target: [B] float32.

    Returns:
        scalar float32.
    """
    # A sum over one-hot rows, because the gradient of a gather is a loop over the batch.
    taken = tf.one_hot(action, q.shape[1])  # [B, A]
    error = tf.reduce_sum(taken * q, axis=1) - target  # [B]
    size = tf.abs(error)
    return tf.reduce_mean(tf.where(size < 1.0, 0.5 * tf.square(error), size - 0.5))
