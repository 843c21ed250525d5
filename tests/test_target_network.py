"""The target network is really separate: what the original's two listings both lack."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import keras_pendulum as kp
from keras_pendulum.agent import Agent
from keras_pendulum.replay import Transitions
from keras_pendulum.run import Run

Weights = list[NDArray[np.float32]]


def agent_with(**changes: Any) -> Agent:
    return Run(kp.preset("reference", hidden_units=(8, 8), **changes)).agent


def batches(count: int) -> Transitions:
    random = np.random.RandomState(0)
    return Transitions(
        random.randn(count, 16, 3).astype(np.float32),
        random.randint(0, 41, (count, 16)).astype(np.int32),
        -random.rand(count, 16).astype(np.float32),
        random.randn(count, 16, 3).astype(np.float32),
        random.rand(count, 16) < 0.2,
    )


def assert_equal(ours: Weights, theirs: Weights) -> None:
    for mine, yours in zip(ours, theirs, strict=True):
        np.testing.assert_array_equal(mine, yours)


def differ(ours: Weights, theirs: Weights) -> bool:
    return any((mine != yours).any() for mine, yours in zip(ours, theirs, strict=True))


@pytest.mark.parametrize("rule", ["hard", "soft"])
def test_it_starts_equal_to_the_online_network_and_shares_nothing_with_it(rule: str) -> None:
    agent = agent_with(target_update=rule)
    assert agent.target is not agent.online
    assert_equal(agent.target.get_weights(), agent.online.get_weights())
    before = agent.target.get_weights()
    agent.online.set_weights([weights + 1 for weights in before])
    assert_equal(agent.target.get_weights(), before)


def test_it_is_frozen_between_hard_refreshes_and_equal_after_one() -> None:
    agent = agent_with(target_update="hard", target_period=5)
    initial = agent.target.get_weights()
    agent.update(batches(4))
    assert differ(agent.online.get_weights(), initial)
    assert_equal(agent.target.get_weights(), initial)
    agent.update(batches(1))
    refreshed = agent.online.get_weights()
    assert_equal(agent.target.get_weights(), refreshed)
    agent.update(batches(4))
    assert differ(agent.online.get_weights(), refreshed)
    assert_equal(agent.target.get_weights(), refreshed)


def test_a_soft_update_is_the_exact_blend() -> None:
    agent = agent_with(target_update="soft", target_blend=0.25)
    target = agent.target.get_weights()
    for _ in range(3):
        agent.update(batches(1))
        online = agent.online.get_weights()
        target = [0.25 * ours + 0.75 * theirs for ours, theirs in zip(online, target, strict=True)]
        for actual, expected in zip(agent.target.get_weights(), target, strict=True):
            np.testing.assert_allclose(actual, expected, rtol=3e-7, atol=1e-8)


def test_gradients_and_the_optimizer_never_reach_it() -> None:
    agent = agent_with(target_update="soft", target_blend=0.0)
    initial = agent.target.get_weights()
    agent.update(batches(20))
    assert differ(agent.online.get_weights(), initial)
    assert_equal(agent.target.get_weights(), initial)


def test_it_and_not_the_online_network_values_the_next_observation() -> None:
    agent = agent_with(target_update="soft", target_blend=0.0, discount=1.0)
    agent.target.set_weights([np.zeros_like(weights) for weights in agent.target.get_weights()])
    agent.target.head.bias.assign(np.full(41, 1000.0))
    (loss,) = agent.update(batches(1))
    # Targets near 1000 on 80 % of the rows, mean over 41 outputs.
    assert loss > 0.5 * 1000**2 / 41
