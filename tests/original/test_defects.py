"""The defects of the original: each one is reproduced, and `reference` does not have it.

tests/dqn/test_target_network.py has more tests of `no-target-network`, and
tests/environments/test_actions.py of `index-truncation`.
"""

from __future__ import annotations

from pathlib import Path

import gymnasium
import keras
import numpy as np
import pytest
from numpy.typing import NDArray

import keras_pendulum as kp
from keras_pendulum.dqn.replay_buffer import Transitions
from keras_pendulum.environments.actions import TorqueGrid, truncated_index
from keras_pendulum.train.loop import train_episodes
from keras_pendulum.train.run import make_run

Floats = NDArray[np.float64]


def test_torque_offset_applies_full_torque_for_every_action() -> None:
    old = np.arange(41) / 10 + 2  # N·m
    assert np.clip(old, -2, 2).min() == 2
    old_indices = [truncated_index(torque) for torque in old]
    assert min(old_indices) >= 40
    assert sum(index > 40 for index in old_indices) == 40  # they crash the update

    torques = make_run(kp.preset("reference")).actions
    assert isinstance(torques, TorqueGrid)
    assert torques.to_env_action(0)[0] == -2
    assert torques.to_env_action(40)[0] == 2
    assert len(np.unique(torques.torques)) == 41


def test_index_truncation_changes_the_replay_buffer_of_the_walkthrough_only() -> None:
    stored = {}
    for name in ("walkthrough", "reference"):
        run = make_run(kp.preset(name, episodes=10, epsilon_start=1, epsilon_decay=1))
        list(train_episodes(run))
        stored[name] = set(run.replay.transitions().action)
    assert stored["walkthrough"] == set(range(41)) - {2, 4}
    assert stored["reference"] == set(range(41))


def test_no_target_network_makes_the_online_network_its_own_target() -> None:
    for name in ("original", "walkthrough"):
        agent = make_run(kp.preset(name)).agent
        assert agent.target is agent.online
    agent = make_run(kp.preset("reference")).agent
    assert agent.target is not agent.online


def test_update_starvation_makes_too_few_updates_even_for_good_data(
    recorded_transitions: Transitions,
) -> None:
    # With the other settings of `reference`, the policy after 459 updates is hardly better than
    # random torques, and the policy after 2000 is good. A hanging pendulum loses π² a step, 10 π²
    # in all with γ = 0.9. So the value there is near -90, and 459 updates hardly approach it.
    assert kp.preset("original").total_updates == 459
    assert kp.preset("reference").total_updates == 40 * 459
    hanging = np.array([[-1, 0, 0]], np.float32)
    random = np.random.RandomState(0)
    agent = make_run(kp.preset("reference")).agent

    def learn(updates: int) -> tuple[float, float]:
        steps = random.randint(0, 100_000, (updates, 32))
        agent.update(Transitions(*(field[steps] for field in recorded_transitions)))
        value = float(agent.online(hanging).numpy().max())
        return value, kp.evaluate_policy(agent.online, episodes=10).mean_return

    value, mean_return = learn(459)
    assert value > -25
    assert mean_return < -600
    value, mean_return = learn(1541)
    assert value < -35
    assert mean_return > -300


def test_hard_coded_batch_fails_for_every_other_batch_size() -> None:
    def old_targets(size: int) -> Floats:
        targets = np.zeros((size, 41))
        for row in range(64):  # the batch's own size is meant
            targets[row, 0] = 1
        return targets

    with pytest.raises(IndexError):
        old_targets(32)
    assert old_targets(128).sum() == 64  # half of the batch has no target

    for size in (1, 128):
        agent = make_run(kp.preset("reference", batch_size=size, hidden_units=(8,))).agent
        batches = Transitions(
            np.ones((1, size, 3), np.float32),
            np.zeros((1, size), np.int32),
            np.full((1, size), -100, np.float32),
            np.ones((1, size, 3), np.float32),
            np.ones((1, size), bool),
        )
        q = agent.online(batches.observation[0]).numpy()[0, 0]
        # Every row counts: the mean over rows of equal error is that error.
        assert agent.update(batches)[0] == pytest.approx((100 + q) ** 2 / 41, rel=1e-5)


def test_unsaved_final_weights_loses_the_last_9_episodes(tmp_path: Path) -> None:
    assert [episode for episode in range(400) if episode % 10 == 0][-1] == 390  # of 399

    config = kp.preset("reference", episodes=42, hidden_units=(8,))  # the last one has updates
    result = kp.train_dqn(config, tmp_path)
    saved = kp.load_weights(tmp_path / "pendulum_weight.h5")
    for ours, theirs in zip(saved.get_weights(), result.network.get_weights(), strict=True):
        np.testing.assert_array_equal(ours, theirs)


def test_unseeded_starts_differ_and_those_of_one_seed_are_equal() -> None:
    def old_start() -> float:
        layer = keras.layers.Dense(8)
        layer.build((None, 3))
        observation, _ = gymnasium.make("Pendulum-v1", g=1.0).reset()
        return float(layer.kernel[0, 0] + observation[0])

    assert old_start() != old_start()
    config = kp.preset("reference", seed=3, episodes=1, hidden_units=(8,))
    assert len({next(train_episodes(make_run(config))).episode_return for _ in range(2)}) == 1
