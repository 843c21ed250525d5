"""The TD target and the losses of Q-learning, as pure functions of tensors.

Each raises TypeError or ValueError when it is traced with another dtype or shape than that below.
tests/torch/torch_agent.py has a PyTorch twin of each.
"""

from __future__ import annotations

import tensorflow as tf

# The axes and the dtype of each tensor below, by its name. B: transitions, A: actions.
_TENSORS = {
    "reward": ("B", tf.float32),
    "terminated": ("B", tf.bool),
    "next_q": ("BA", tf.float32),  # the target network's values of the next observations
    "next_q_online": ("BA", tf.float32),  # the online network's values of them
    "q": ("BA", tf.float32),  # the online network's values of the observations
    "action": ("B", tf.int32),  # indices of the actions that were taken
    "target": ("B", tf.float32),  # TD targets
}


def td_target(
    reward: tf.Tensor, terminated: tf.Tensor, next_q: tf.Tensor, discount: float
) -> tf.Tensor:
    """Returns the TD targets [B]: r + γ·max Q(next) [B, A], and r after termination.

    No gradient flows through them. Source: Mnih et al. 2015, Methods, "Training algorithm for deep
    Q-networks".
    """
    _check(reward=reward, terminated=terminated, next_q=next_q)
    bootstrap = tf.where(terminated, 0.0, discount * tf.reduce_max(next_q, axis=1))  # [B]
    return tf.stop_gradient(reward + bootstrap)


def double_td_target(
    reward: tf.Tensor,
    terminated: tf.Tensor,
    next_q: tf.Tensor,
    next_q_online: tf.Tensor,
    discount: float,
) -> tf.Tensor:
    """Returns the TD targets [B] with the next action chosen by the online values [B, A].

    The maximum of noisy values is too high on average. Two networks seldom overestimate the same
    action. No gradient flows through the targets. Source: van Hasselt et al. 2016, section "Double
    DQN".
    """
    _check(reward=reward, terminated=terminated, next_q=next_q, next_q_online=next_q_online)
    next_action = tf.argmax(next_q_online, axis=1)  # [B]
    value = tf.gather(next_q, next_action, batch_dims=1)  # [B]
    return tf.stop_gradient(reward + tf.where(terminated, 0.0, discount * value))


def mean_squared_error(q: tf.Tensor, action: tf.Tensor, target: tf.Tensor) -> tf.Tensor:
    """Returns the original's loss, a scalar: the squared TD error, averaged over all B·A outputs.

    Each output of an action that was not taken is its own target. So the loss equals the mean
    squared TD error of the taken actions, divided by A.
    """
    _check(q=q, action=action, target=target)
    taken = tf.one_hot(action, q.shape[1], on_value=True, off_value=False)  # [B, A]
    target_q = tf.where(taken, target[:, tf.newaxis], tf.stop_gradient(q))  # [B, A]
    return tf.reduce_mean(tf.square(target_q - q))


def huber(q: tf.Tensor, action: tf.Tensor, target: tf.Tensor) -> tf.Tensor:
    """Returns the notebooks' loss, a scalar: the mean Huber loss of the taken actions, δ = 1.

    It is half the square of a TD error up to 1, and its absolute value minus 1/2 beyond. Source:
    Mnih et al. 2015, Methods, on clipping the error.
    """
    _check(q=q, action=action, target=target)
    # A sum over one-hot rows, because the gradient of a gather is a loop over the batch.
    taken = tf.one_hot(action, q.shape[1])  # [B, A]
    error = tf.reduce_sum(taken * q, axis=1) - target  # [B]
    size = tf.abs(error)
    return tf.reduce_mean(tf.where(size < 1.0, 0.5 * tf.square(error), size - 0.5))


def _check(**tensors: tf.Tensor) -> None:
    """Raises TypeError or ValueError where a dtype or a static shape is not as in `_TENSORS`.

    An axis has the same size in all tensors. A compiled function does not contain the check.
    """
    sizes: dict[str, int | None] = {}  # of the axes; None where the trace does not know it
    for name, tensor in tensors.items():
        axes, dtype = _TENSORS[name]
        if dtype != tensor.dtype:
            raise TypeError(f"{name} is {tf.as_dtype(tensor.dtype).name}, expected {dtype.name}")
        shape = tf.TensorShape(tensor.shape)
        expected = tf.TensorShape([sizes.get(axis) for axis in axes])
        if not shape.is_compatible_with(expected):
            raise ValueError(f"{name} has shape {shape}, expected [{', '.join(axes)}] = {expected}")
        sizes.update(zip(axes, shape.merge_with(expected), strict=True))
