"""TD targets and losses against numbers computed by hand.

tests/torch/test_torch.py compares them with PyTorch.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import tensorflow as tf

from keras_pendulum.dqn.losses import double_td_target, huber, mean_squared_error, td_target

REWARD = tf.constant([10.0, 20.0, 30.0])  # [B]
TERMINATED = tf.constant([False, True, False])  # [B]
NEXT_Q = tf.constant([[1.0, 5.0, 2.0], [7.0, 0.0, 1.0], [-3.0, -1.0, -2.0]])  # [B, A]
# The online network chooses action 0, 2 and 2.
NEXT_Q_ONLINE = tf.constant([[9.0, 8.0, 7.0], [0.0, 1.0, 2.0], [1.0, 2.0, 3.0]])  # [B, A]
NO_END = tf.zeros(3, bool)


def gradient(loss: Callable[..., tf.Tensor], q: tf.Tensor, *others: tf.Tensor) -> Any:
    """Returns the gradient [B, A] of a loss by the Q-values."""
    with tf.GradientTape() as tape:
        tape.watch(q)
        value = loss(q, *others)
    return tape.gradient(value, q).numpy()


def test_target_is_the_reward_plus_the_discounted_highest_value() -> None:
    target = td_target(REWARD, TERMINATED, NEXT_Q, 0.5)
    np.testing.assert_array_equal(target, [10 + 0.5 * 5, 20, 30 + 0.5 * -1])


def test_double_target_is_the_value_of_the_action_that_the_online_network_chooses() -> None:
    target = double_td_target(REWARD, TERMINATED, NEXT_Q, NEXT_Q_ONLINE, 0.5)
    np.testing.assert_array_equal(target, [10 + 0.5 * 1, 20, 30 + 0.5 * -2])


def test_target_after_termination_is_the_reward_whatever_the_next_values() -> None:
    ended = tf.ones(3, bool)
    for next_q in (NEXT_Q, tf.fill((3, 3), np.inf), tf.fill((3, 3), np.nan)):
        np.testing.assert_array_equal(td_target(REWARD, ended, next_q, 0.9), REWARD)
        np.testing.assert_array_equal(
            double_td_target(REWARD, ended, next_q, NEXT_Q_ONLINE, 0.9), REWARD
        )


def test_no_gradient_flows_through_the_targets() -> None:
    inputs = [REWARD, NEXT_Q, NEXT_Q_ONLINE]
    with tf.GradientTape(persistent=True) as tape:
        tape.watch(inputs)
        target = td_target(REWARD, NO_END, NEXT_Q, 0.9)
        double_target = double_td_target(REWARD, NO_END, NEXT_Q, NEXT_Q_ONLINE, 0.9)
    assert tape.gradient(target, inputs) == [None, None, None]
    assert tape.gradient(double_target, inputs) == [None, None, None]


def test_mean_squared_error_is_the_squared_error_of_taken_actions_over_all_outputs() -> None:
    q = tf.constant([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    batch = (tf.constant([1, 0]), tf.constant([5.0, 1.0]))
    assert float(mean_squared_error(q, *batch)) == pytest.approx(((5 - 2) ** 2 + (1 - 4) ** 2) / 6)
    expected = [[0, 2 * (2 - 5) / 6, 0], [2 * (4 - 1) / 6, 0, 0]]
    np.testing.assert_allclose(gradient(mean_squared_error, q, *batch), expected, rtol=1e-6)


# The TD error q - target, its Huber loss and the slope of that loss, with δ = 1.
HUBER = [
    (0.0, 0.0, 0.0),
    (0.5, 0.125, 0.5),
    (-0.5, 0.125, -0.5),
    (1.0, 0.5, 1.0),
    (-1.0, 0.5, -1.0),
    (3.0, 2.5, 1.0),
    (-3.0, 2.5, -1.0),
    (1e25, 1e25, 1.0),  # its square is beyond float32
]


@pytest.mark.parametrize(("error", "loss", "slope"), HUBER)
def test_huber_is_half_the_square_up_to_1_and_linear_beyond(
    error: float, loss: float, slope: float
) -> None:
    q = tf.constant([[9.0, 0.0, 9.0]])
    batch = (tf.constant([1]), tf.constant([-error], tf.float32))
    assert float(huber(q, *batch)) == pytest.approx(loss, rel=1e-6)
    np.testing.assert_allclose(gradient(huber, q, *batch), [[0, slope, 0]], rtol=1e-6)


def test_huber_is_the_mean_over_the_taken_actions() -> None:
    q = tf.constant([[0.5, 9.0], [9.0, 3.0], [9.0, -2.0]])
    batch = (tf.constant([0, 1, 1]), tf.constant([0.0, 0.0, -3.5]))  # errors 0.5, 3 and 1.5
    assert float(huber(q, *batch)) == pytest.approx((0.125 + 2.5 + 1.0) / 3)
    slope = gradient(huber, q, *batch)
    np.testing.assert_allclose(slope, [[0.5 / 3, 0], [0, 1 / 3], [0, 1 / 3]], rtol=1e-6)


ARGUMENTS: dict[Callable[..., tf.Tensor], dict[str, tf.Tensor]] = {
    td_target: {"reward": REWARD, "terminated": TERMINATED, "next_q": NEXT_Q},
    double_td_target: {
        **{"reward": REWARD, "terminated": TERMINATED},
        **{"next_q": NEXT_Q, "next_q_online": NEXT_Q_ONLINE},
    },
    mean_squared_error: {"q": NEXT_Q, "action": tf.constant([1, 0, 2]), "target": REWARD},
    huber: {"q": NEXT_Q, "action": tf.constant([1, 0, 2]), "target": REWARD},
}
EACH_ARGUMENT = pytest.mark.parametrize(
    ("function", "name"),
    [(function, name) for function, tensors in ARGUMENTS.items() for name in tensors],
)


def trace(function: Callable[..., tf.Tensor], **changes: tf.Tensor) -> Any:
    """Returns the graph of a function of `ARGUMENTS`."""
    tensors = {**ARGUMENTS[function], **changes}
    others = {"discount": 0.9} if "reward" in tensors else {}
    return tf.function(lambda values: function(**values, **others)).get_concrete_function(tensors)


@EACH_ARGUMENT
def test_tensor_of_another_shape_is_refused_when_the_function_is_traced(
    function: Callable[..., tf.Tensor], name: str
) -> None:
    right = ARGUMENTS[function][name]  # [3] or [3, 3]
    for wrong in (right[..., tf.newaxis], right[:1], right[0], right[0:0]):
        with pytest.raises(ValueError, match=r"\w+ has shape \(.*\), expected \[B(, A)?\] = \("):
            trace(function, **{name: wrong})


@EACH_ARGUMENT
def test_tensor_of_another_dtype_is_refused_when_the_function_is_traced(
    function: Callable[..., tf.Tensor], name: str
) -> None:
    with pytest.raises(TypeError, match=f"{name} is float64, expected (float32|bool|int32)$"):
        trace(function, **{name: tf.cast(ARGUMENTS[function][name], tf.float64)})


def test_error_names_the_tensor_and_both_shapes() -> None:
    batch = (tf.constant([1, 0, 2]), REWARD[:, tf.newaxis])
    with pytest.raises(ValueError, match=r"^target has shape \(3, 1\), expected \[B\] = \(3,\)$"):
        huber(NEXT_Q, *batch)


@pytest.mark.parametrize("function", ARGUMENTS)
def test_checks_accept_unknown_sizes_and_add_nothing_to_the_graph(
    function: Callable[..., tf.Tensor], monkeypatch: pytest.MonkeyPatch
) -> None:
    unknown = {
        name: tf.TensorSpec([None, 3][: tensor.ndim], tensor.dtype)
        for name, tensor in ARGUMENTS[function].items()
    }
    assert trace(function, **unknown).structured_outputs.dtype == tf.float32
    checked = len(trace(function).graph.get_operations())
    monkeypatch.setattr("keras_pendulum.dqn.losses._check", lambda **tensors: None)
    assert len(trace(function).graph.get_operations()) == checked
