"""The defects of the original: each one is reproduced, and `reference` does not have it.

tests/dqn/test_target_network.py has more tests of `no-target-network`.
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
from keras_pendulum.environments.actions import (
    Actions,
    TorqueGrid,
    TruncatingTorqueGrid,
    truncated_index,
)
from keras_pendulum.train.loop import train_episodes
from keras_pendulum.train.run import make_run

Floats = NDArray[np.float64]


def actions_of(preset: str) -> Actions:
    config = kp.preset(preset)
    return make_run(config).actions


def wrong_indices(stored: list[int]) -> dict[int, int]:
    """Returns the stored index of each action whose stored index is not its own."""
    return {index: other for index, other in enumerate(stored) if other != index}


def test_torque_offset_applies_full_torque_for_every_action() -> None:
    old = np.arange(41) / 10 + 2  # N·m
    assert np.clip(old, -2, 2).min() == 2
    old_indices = [truncated_index(torque) for torque in old]
    assert min(old_indices) >= 40
    assert sum(index > 40 for index in old_indices) == 40  # they crash the update

    torques = actions_of("reference")
    assert isinstance(torques, TorqueGrid)
    assert torques.to_env_action(0)[0] == -2
    assert torques.to_env_action(40)[0] == 2
    assert len(np.unique(torques.torques)) == 41


def test_index_truncation_stores_two_torques_as_their_neighbours() -> None:
    old, new = actions_of("walkthrough"), actions_of("reference")
    assert isinstance(old, TruncatingTorqueGrid)
    assert wrong_indices([old.stored_index(index) for index in range(41)]) == {2: 1, 4: 3}
    assert wrong_indices([new.stored_index(index) for index in range(41)]) == {}

    float32 = [truncated_index(np.float32(index / 10 - 2)) for index in range(41)]
    assert wrong_indices(float32) == {3: 2, 4: 3, 8: 7}


def test_index_truncation_changes_the_replay_buffer_of_the_walkthrough_only() -> None:
    stored = {}
    for name in ("walkthrough", "reference"):
        run = make_run(kp.preset(name, episodes=10, epsilon_start=1, epsilon_decay=1))
        list(train_episodes(run))
        stored[name] = set(run.replay.transitions().action)
    assert stored["walkthrough"] == set(range(41)) - {2, 4}
    assert stored["reference"] == set(range(41))


def test_float_equality_finds_every_index_in_float64_only() -> None:
    # The final listing looks up its index like this. It works by luck of the dtype.
    grid = np.linspace(-2, 2, 41)
    assert all((grid == torque).sum() == 1 for torque in grid)
    assert (grid == grid.astype(np.float32)).sum() == 9
    new = TorqueGrid(41)
    indices = [new.nearest_index(float(torque)) for torque in grid.astype(np.float32)]
    assert indices == list(range(41))


def test_no_target_network_makes_the_online_network_its_own_target() -> None:
    for name in ("original", "walkthrough"):
        agent = make_run(kp.preset(name)).agent
        assert agent.target is agent.online
    agent = make_run(kp.preset("reference")).agent
    assert agent.target is not agent.online


def test_no_target_network_copies_the_weights_of_a_network_to_itself() -> None:
    # The "sync" of the walkthrough.
    network = kp.DQN((8,), 41)
    before = network.get_weights()
    network.set_weights(network.get_weights())
    for ours, theirs in zip(before, network.get_weights(), strict=True):
        np.testing.assert_array_equal(ours, theirs)


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
    def old_targets(q: Floats, actions: NDArray[np.int64], values: Floats) -> Floats:
        targets = q.copy()
        for row in range(64):  # the batch's own size is meant
            targets[row, actions[row]] = values[row]
        return targets

    def old_batch(size: int) -> tuple[Floats, NDArray[np.int64], Floats]:
        return np.zeros((size, 41)), np.zeros(size, np.int64), np.ones(size)

    with pytest.raises(IndexError):
        old_targets(*old_batch(32))
    assert old_targets(*old_batch(128)).sum() == 64  # half of the batch has no target

    for size in (1, 32, 64, 128):
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

    config = kp.preset("reference", episodes=46, hidden_units=(8,))
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

    def new_start() -> float:
        run = make_run(kp.preset("reference", seed=3, episodes=1, hidden_units=(8,)))
        (record,) = train_episodes(run)
        return record.episode_return

    assert new_start() == new_start()
