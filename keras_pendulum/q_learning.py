"""The target and the loss of Q-learning, as pure functions of tensors.

Each has a PyTorch twin in tests/torch_agent.py.
"""

from __future__ import annotations

import tensorflow as tf


def td_target(
    reward: tf.Tensor, terminated: tf.Tensor, next_q: tf.Tensor, discount: float
) -> tf.Tensor:
    """The value to learn towards: r + γ·max Q(next), without the second term after termination.

    Mnih et al. 2015, equation in Methods, "Training algorithm for deep Q-networks".

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
    """The same with the next action chosen by the online network, valued by the target network.

    A maximum over values that err picks what is overrated; a second network seldom overrates the
    same action. Van Hasselt et al. 2016, section "Double DQN".

    Args:
        reward: [B] float32.
        terminated: [B] bool.
        next_q: [B, A] float32, the target network's values of the next observations.
        next_q_online: [B, A] float32, the online network's.
        discount: γ.

    Returns:
        [B] float32. No gradient flows through it.
    """
    best = tf.argmax(next_q_online, axis=1)  # [B]
    value = tf.gather(next_q, best, batch_dims=1)  # [B]
    return tf.stop_gradient(reward + tf.where(terminated, 0.0, discount * value))


def mean_squared_error(q: tf.Tensor, action: tf.Tensor, target: tf.Tensor) -> tf.Tensor:
    """The original's loss: the squared error averaged over all B·A outputs.

    The target of an output that was not taken is the output itself, so this equals the taken
    actions' mean squared error divided by A.

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
    """The notebooks' loss: Huber's, δ = 1, of the taken actions' errors, averaged over the batch.

    Half the square of an error up to 1, its absolute value less 1/2 beyond (Mnih et al. 2015,
    Methods, "error clipping").

    Args:
        q: [B, A] float32, the online network's values.
        action: [B] int32.
        target: [B] float32.

    Returns:
        scalar float32.
    """
    # A sum with one term each, because the gradient of a gather is a loop over the batch.
    taken = tf.one_hot(action, q.shape[1])  # [B, A]
    error = tf.reduce_sum(taken * q, axis=1) - target  # [B]
    size = tf.abs(error)
    return tf.reduce_mean(tf.where(size < 1.0, 0.5 * tf.square(error), size - 0.5))
