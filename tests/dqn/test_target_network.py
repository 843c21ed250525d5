"""The target network, which both listings of the original lack."""

from __future__ import annotations

from typing import Any

import keras
import numpy as np
import pytest
import tensorflow as tf
from numpy.typing import NDArray

import keras_pendulum as kp
from keras_pendulum.dqn.agent import Agent
from keras_pendulum.dqn.losses import mean_squared_error
from keras_pendulum.dqn.network import DQN
from keras_pendulum.dqn.replay_buffer import Transitions
from keras_pendulum.dqn.target_network import hard_update, make_target, soft_update

Weights = list[NDArray[np.float32]]


def make_agent(**changes: Any) -> Agent:
    config = kp.preset("reference", **changes)
    online = DQN((8, 8))
    return Agent(
        online,
        *make_target(online, config),
        keras.optimizers.Adam(1e-3),
        mean_squared_error,
        config.discount,
        False,
        np.random.RandomState(0),
    )


def random_batches(count: int) -> Transitions:
    random = np.random.RandomState(0)
    return Transitions(
        random.randn(count, 16, 3).astype(np.float32),
        random.randint(0, 41, (count, 16)).astype(np.int32),
        -random.rand(count, 16).astype(np.float32),
        random.randn(count, 16, 3).astype(np.float32),
        random.rand(count, 16) < 0.2,
    )


def filled(value: float) -> DQN:
    """Returns a network whose weights all have one value."""
    network = DQN((2,), 2)
    network.set_weights([np.full(weights.shape, value) for weights in network.get_weights()])
    return network


def assert_filled(network: DQN, value: float) -> None:
    for weights in network.get_weights():
        np.testing.assert_allclose(weights, np.full(weights.shape, value), rtol=1e-6)


def assert_equal(ours: Weights, theirs: Weights) -> None:
    for mine, yours in zip(ours, theirs, strict=True):
        np.testing.assert_array_equal(mine, yours)


def differ(ours: Weights, theirs: Weights) -> bool:
    return any((mine != yours).any() for mine, yours in zip(ours, theirs, strict=True))


def test_soft_update_moves_the_target_by_tau() -> None:
    online, target = filled(8.0), filled(0.0)
    update = soft_update(0.25)
    for step, value in enumerate((2.0, 3.5, 4.625), start=1):
        update(online, target, tf.constant(step))
        assert_filled(target, value)
    assert_filled(online, 8.0)


@pytest.mark.parametrize(("tau", "value"), [(0.0, 3.0), (1.0, 8.0)])
def test_soft_update_with_tau_0_or_1_keeps_or_copies(tau: float, value: float) -> None:
    online, target = filled(8.0), filled(3.0)
    soft_update(tau)(online, target, tf.constant(1))
    assert_filled(target, value)


def test_hard_update_copies_at_every_period() -> None:
    online, target = filled(0.0), filled(-1.0)
    update = hard_update(3)
    copied = []
    for step in range(1, 10):
        online.set_weights(filled(step).get_weights())
        update(online, target, tf.constant(step, tf.int64))
        copied.append(float(target.get_weights()[-1][0]))
    assert copied == [-1, -1, 3, 3, 3, 6, 6, 6, 9]


@pytest.mark.parametrize("rule", ["hard", "soft"])
def test_target_starts_equal_to_the_online_network_with_its_own_variables(rule: str) -> None:
    online = DQN((8, 8))
    target, _ = make_target(online, kp.preset("reference", target_update=rule))
    before = online.get_weights()
    assert target is not online
    assert_equal(target.get_weights(), before)
    online.set_weights([weights + 1 for weights in before])
    assert_equal(target.get_weights(), before)


def test_online_network_is_its_own_target_without_a_target_update() -> None:
    online = DQN((8, 8))
    before = online.get_weights()
    target, update_target = make_target(online, kp.preset("reference", target_update="none"))
    assert target is online
    update_target(online, target, tf.constant(1))
    assert_equal(online.get_weights(), before)


def test_target_changes_at_hard_updates_only() -> None:
    agent = make_agent(target_update="hard", target_period=5)
    initial = agent.target.get_weights()
    agent.update(random_batches(4))
    assert differ(agent.online.get_weights(), initial)
    assert_equal(agent.target.get_weights(), initial)
    agent.update(random_batches(1))
    copied = agent.online.get_weights()
    assert_equal(agent.target.get_weights(), copied)
    agent.update(random_batches(4))
    assert differ(agent.online.get_weights(), copied)
    assert_equal(agent.target.get_weights(), copied)


def test_soft_update_follows_each_gradient_step() -> None:
    agent = make_agent(target_update="soft", tau=0.25)
    target = agent.target.get_weights()
    for _ in range(3):
        agent.update(random_batches(1))
        online = agent.online.get_weights()
        target = [0.25 * ours + 0.75 * theirs for ours, theirs in zip(online, target, strict=True)]
        for actual, expected in zip(agent.target.get_weights(), target, strict=True):
            np.testing.assert_allclose(actual, expected, rtol=3e-7, atol=1e-8)


def test_optimizer_does_not_change_the_target() -> None:
    agent = make_agent(target_update="soft", tau=0.0)
    initial = agent.target.get_weights()
    agent.update(random_batches(20))
    assert differ(agent.online.get_weights(), initial)
    assert_equal(agent.target.get_weights(), initial)
