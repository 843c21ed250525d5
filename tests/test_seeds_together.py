"""Several seeds in one program: docs/scaling.md says that they learn the same."""

from __future__ import annotations

import os

import numpy as np
import pytest

import keras_pendulum as kp
from keras_pendulum.policy import GreedyPolicy
from keras_pendulum.randomness import RandomSource
from keras_pendulum.replay import Transitions
from keras_pendulum.run import make_agent


def test_stacked_networks_learn_and_act_as_each_does_alone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with monkeypatch.context() as patch:
        # The benchmark keeps its process to one thread, which is not for the other tests' programs.
        patch.setattr(os, "environ", dict(os.environ))
        from benchmarks.seeds_together import batches, stacked, stacked_actions, stacked_agent

    config = kp.preset("reference", hidden_units=(32, 16), updates_per_episode=30)
    agents = [make_agent(config, RandomSource(0)) for _ in range(2)]
    agents[1].online.set_weights([-weight for weight in agents[1].online.get_weights()])
    agents[1].target.set_weights(agents[1].online.get_weights())
    together = stacked_agent(agents, config)
    own = [batches(config, seed) for seed in range(2)]
    before = stacked(agents)

    for agent, each in zip(agents, own, strict=True):
        agent.update(each)
    together.update(
        Transitions(*(np.concatenate(field, axis=1) for field in zip(*own, strict=True)))
    )

    after = stacked(agents)
    assert all(np.abs(new - old).max() > 1e-4 for new, old in zip(after, before, strict=True))
    for alone, joint in zip(after, together.online.weights, strict=True):
        np.testing.assert_allclose(joint.numpy(), alone, rtol=0, atol=1e-6)
    observations = np.array([[1, 0, 0.1], [-1, 0, 2]], np.float32)
    assert stacked_actions(after, observations).tolist() == [
        GreedyPolicy(agent.online).action(observation)
        for agent, observation in zip(agents, observations, strict=True)
    ]
