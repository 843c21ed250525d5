"""The greedy policy in NumPy, against the network and against numbers computed by hand."""

from __future__ import annotations

import numpy as np
import pytest

from keras_pendulum.dqn.network import DQN
from keras_pendulum.dqn.policy import ACTIVATIONS, GreedyPolicy, greedy_policy

OBSERVATIONS = np.random.RandomState(0).randn(50, 3).astype(np.float32)  # [B, D]


@pytest.mark.parametrize("activation", ACTIVATIONS)
def test_q_values_are_those_of_the_network(activation: str) -> None:
    network = DQN((64, 32), activation=activation)
    policy = greedy_policy(network)
    expected = network(OBSERVATIONS).numpy()
    np.testing.assert_allclose(policy.q_values(OBSERVATIONS), expected, atol=1e-6)
    for observation, q in zip(OBSERVATIONS, expected, strict=True):
        np.testing.assert_allclose(policy.q_values(observation), q, atol=1e-6)
        assert policy.action(observation) == q.argmax()


def test_policy_leaves_observation_and_weights_as_they_are() -> None:
    network = DQN((8,), activation="relu")
    weights = network.get_weights()
    policy = GreedyPolicy(weights, "relu")
    observations = OBSERVATIONS.copy()
    policy.q_values(observations)
    np.testing.assert_array_equal(observations, OBSERVATIONS)
    for ours, theirs in zip(weights, network.get_weights(), strict=True):
        np.testing.assert_array_equal(ours, theirs)


def test_action_is_the_lowest_index_of_equal_values() -> None:
    bias = np.array([1, 5, 5, 5], np.float32)
    policy = GreedyPolicy([np.zeros((3, 4), np.float32), bias], "tanh")
    action = policy.action(OBSERVATIONS[0])
    assert (action, type(action)) == (1, int)
