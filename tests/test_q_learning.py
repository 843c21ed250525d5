from __future__ import annotations

import numpy as np
import tensorflow as tf

from keras_pendulum.q_learning import double_td_target, mean_squared_error, td_target

NEXT_Q = tf.constant([[1.0, 5.0, 2.0], [7.0, 0.0, 1.0], [-3.0, -1.0, -2.0]])  # [3, 3]


def test_target_by_hand() -> None:
    reward = tf.constant([10.0, 20.0, 30.0])
    terminated = tf.constant([False, True, False])
    target = td_target(reward, terminated, NEXT_Q, 0.5)
    np.testing.assert_allclose(target, [10 + 2.5, 20, 30 - 0.5])


def test_target_with_discount_0_is_the_reward() -> None:
    reward = tf.constant([10.0, 20.0, 30.0])
    np.testing.assert_allclose(td_target(reward, tf.zeros(3, bool), NEXT_Q, 0.0), reward)


def test_no_gradient_flows_through_the_target() -> None:
    with tf.GradientTape() as tape:
        tape.watch(NEXT_Q)
        target = td_target(tf.zeros(3), tf.zeros(3, bool), NEXT_Q, 0.9)
    assert tape.gradient(target, NEXT_Q) is None


def test_double_target_by_hand_values_what_the_online_network_chooses() -> None:
    reward = tf.constant([10.0, 20.0, 30.0])
    terminated = tf.constant([False, True, False])
    next_q_online = tf.constant([[9.0, 8.0, 7.0], [0.0, 1.0, 2.0], [1.0, 2.0, 3.0]])
    target = double_td_target(reward, terminated, NEXT_Q, next_q_online, 0.5)
    np.testing.assert_allclose(target, [10 + 0.5 * 1, 20, 30 + 0.5 * -2])


def test_double_target_is_the_plain_one_where_both_networks_are_the_same() -> None:
    reward, terminated = tf.zeros(3), tf.zeros(3, bool)
    np.testing.assert_array_equal(
        double_td_target(reward, terminated, NEXT_Q, NEXT_Q, 0.9),
        td_target(reward, terminated, NEXT_Q, 0.9),
    )


def test_no_gradient_flows_through_the_double_target() -> None:
    with tf.GradientTape() as tape:
        tape.watch(NEXT_Q)
        target = double_td_target(tf.zeros(3), tf.zeros(3, bool), NEXT_Q, NEXT_Q, 0.9)
    assert tape.gradient(target, NEXT_Q) is None


def test_loss_by_hand_is_the_taken_actions_squared_error_over_all_outputs() -> None:
    q = tf.constant([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    loss = mean_squared_error(q, tf.constant([2, 0]), tf.constant([5.0, 1.0]))
    np.testing.assert_allclose(loss, ((5 - 3) ** 2 + (1 - 4) ** 2) / 6)


def test_loss_against_a_scalar_loop() -> None:
    random = np.random.RandomState(0)
    q = random.randn(32, 41).astype(np.float32)
    action = random.randint(0, 41, 32).astype(np.int32)
    target = random.randn(32).astype(np.float32)
    total = 0.0
    for row in range(32):
        for output in range(41):
            wanted = target[row] if output == action[row] else q[row, output]
            total += float(wanted - q[row, output]) ** 2
    loss = mean_squared_error(tf.constant(q), tf.constant(action), tf.constant(target))
    np.testing.assert_allclose(loss, total / (32 * 41), rtol=1e-5)


def test_only_the_taken_actions_output_has_a_gradient() -> None:
    q = tf.constant([[1.0, 2.0, 3.0]])
    with tf.GradientTape() as tape:
        tape.watch(q)
        loss = mean_squared_error(q, tf.constant([1]), tf.constant([5.0]))
    np.testing.assert_allclose(tape.gradient(loss, q), [[0, 2 * (2 - 5) / 3, 0]])
