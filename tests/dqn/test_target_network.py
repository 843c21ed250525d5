"""The rules that update the target network, which both listings of the original lack."""

from __future__ import annotations

import numpy as np
import pytest
import tensorflow as tf

from keras_pendulum.dqn.network import DQN
from keras_pendulum.dqn.target_network import hard_update, soft_update


def filled(value: float) -> DQN:
    """Returns a network whose weights all have one value."""
    network = DQN((2,), 2)
    network.set_weights([np.full(weights.shape, value) for weights in network.get_weights()])
    return network


def assert_filled(network: DQN, value: float) -> None:
    for weights in network.get_weights():
        np.testing.assert_allclose(weights, np.full(weights.shape, value), rtol=1e-6)


@pytest.mark.parametrize(
    ("tau", "values"), [(0.25, [2, 3.5, 4.625]), (0.0, [0, 0, 0]), (1.0, [8, 8, 8])]
)
def test_soft_update_moves_the_target_by_tau(tau: float, values: list[float]) -> None:
    online, target = filled(8.0), filled(0.0)
    for step, value in enumerate(values, start=1):
        soft_update(tau, online, target, tf.constant(step))
        assert_filled(target, value)
    assert_filled(online, 8.0)


def test_hard_update_copies_at_every_period() -> None:
    online, target = filled(0.0), filled(-1.0)
    for step, value in enumerate([-1, -1, 3, 3, 3, 6, 6, 6, 9], start=1):
        online.set_weights(filled(step).get_weights())
        hard_update(3, online, target, tf.constant(step, tf.int64))
        assert_filled(target, value)
