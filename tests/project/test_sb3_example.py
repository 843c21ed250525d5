"""examples/sb3_dqn.py: its wrapper, and with Stable-Baselines3 a short training."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest
from conftest import ROOT
from test_probes import module_of

import keras_pendulum as kp

example = module_of(ROOT / "examples" / "sb3_dqn.py")


def test_index_acts_as_its_torque_and_the_reward_is_scaled() -> None:
    env, plain = example.make_env(), gymnasium.make("Pendulum-v1")
    assert env.action_space.n == len(example.TORQUES)
    for each in (env, plain):
        each.reset(seed=1)
    for index in (0, 5, 10):
        observation, reward, *_ = env.step(index)
        expected, plain_reward, *_ = plain.step([example.TORQUES[index]])
        np.testing.assert_allclose(observation, expected, atol=1e-6)
        assert reward == pytest.approx(0.02 * float(plain_reward))


def test_short_training_can_be_evaluated() -> None:
    pytest.importorskip("stable_baselines3")
    model = example.train(example.make_env(), steps=1_400)
    score = kp.evaluate_policy(
        model, episodes=5, gravity=10.0, torques=example.TORQUES, discount=example.DISCOUNT
    )
    assert score.discount == example.DISCOUNT
    assert np.isfinite(score.regret)
