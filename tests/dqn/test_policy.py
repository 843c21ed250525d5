"""The greedy policy in NumPy, against the network and against numbers computed by hand."""

from __future__ import annotations

import numpy as np
import pytest
from small_agents import assert_weights

from keras_pendulum.dqn.network import DQN
from keras_pendulum.dqn.policy import ACTIVATIONS, GreedyPolicy, greedy_policy

OBSERVATIONS = np.random.RandomState(0).randn(50, 3).astype(np.float32)  # [B, D]


@pytest.mark.parametrize("activation", [*ACTIVATIONS, "relu,linear"])
def test_q_values_are_those_of_the_network(activation: str) -> None:
    network = DQN((64, 32), activation=activation)
    policy = greedy_policy(network)
    expected = network(OBSERVATIONS).numpy()
    np.testing.assert_allclose(policy.q_values(OBSERVATIONS), expected, atol=1e-6)
    for observation, q in zip(OBSERVATIONS, expected, strict=True):
        alone = policy.q_values(observation)
        np.testing.assert_allclose(alone, q, atol=1e-6)
        # Stable-Baselines3 asks with a batch of one, and its returns are those of evaluate_policy.
        np.testing.assert_array_equal(policy.q_values(observation[np.newaxis])[0], alone)
        assert policy.action(observation) == q.argmax()


def test_policy_leaves_observation_and_weights_as_they_are() -> None:
    network = DQN((8,), activation="relu")
    weights = network.get_weights()
    policy = GreedyPolicy(weights, "relu")
    observations = OBSERVATIONS.copy()
    policy.q_values(observations)
    np.testing.assert_array_equal(observations, OBSERVATIONS)
    assert_weights(weights, network.get_weights())


def test_action_is_the_lowest_index_of_equal_values() -> None:
    bias = np.array([1, 5, 5, 5], np.float32)
    policy = GreedyPolicy([np.zeros((3, 4), np.float32), bias], "tanh")
    action = policy.action(OBSERVATIONS[0])
    assert (action, type(action)) == (1, int)
