"""Each defect of the original: shown in its old form, absent from `reference`.

`no-target-network` has tests of its own kind in test_target_network.py.
"""

from __future__ import annotations

from pathlib import Path

import gymnasium
import keras
import numpy as np
import pytest

import keras_pendulum as kp
from keras_pendulum.defects import TruncatingTorqueGrid, truncated_index
from keras_pendulum.replay import ReplayBuffer, Transitions
from keras_pendulum.run import Run, actions_of
from keras_pendulum.torque import TorqueGrid


def test_torque_offset_the_first_block_pushes_at_full_torque_whatever_the_action() -> None:
    old = np.arange(41) / 10 + 2  # N·m
    assert np.clip(old, -2, 2).min() == 2
    old_indices = [truncated_index(torque) for torque in old]
    assert min(old_indices) >= 40
    assert sum(index > 40 for index in old_indices) == 40  # they crash the update

    torques = actions_of(kp.preset("reference"))
    assert isinstance(torques, TorqueGrid)
    assert torques.control(0)[0] == -2
    assert torques.control(40)[0] == 2
    assert len(np.unique(torques.torques)) == 41


def test_index_truncation_credits_two_torques_to_their_neighbours() -> None:
    old = actions_of(kp.preset("walkthrough"))
    assert isinstance(old, TruncatingTorqueGrid)
    remembered = [old.remembered_index(index) for index in range(41)]
    wrong = {index: kept for index, kept in enumerate(remembered) if kept != index}
    assert wrong == {2: 1, 4: 3}

    single = [truncated_index(np.float32(index / 10 - 2)) for index in range(41)]
    assert {i: kept for i, kept in enumerate(single) if kept != i} == {3: 2, 4: 3, 8: 7}

    new = actions_of(kp.preset("reference"))
    assert [new.remembered_index(index) for index in range(41)] == list(range(41))


def test_index_truncation_reaches_the_replay_buffer_of_the_walkthrough_only() -> None:
    remembered = {}
    for name in ("walkthrough", "reference"):
        run = Run(kp.preset(name, episodes=10, epsilon_start=1, epsilon_decay=1))
        for _ in run.episodes():
            pass
        remembered[name] = set(run.replay.at(range(len(run.replay))).action)
    assert remembered["walkthrough"] == set(range(41)) - {2, 4}
    assert remembered["reference"] == set(range(41))


def test_float_equality_finds_the_index_in_float64_only() -> None:
    """How the final listing looks its index up; it works by luck of the dtype."""
    grid = np.linspace(-2, 2, 41)
    assert all((grid == torque).sum() == 1 for torque in grid)
    assert (grid == grid.astype(np.float32)).sum() == 9
    new = TorqueGrid(41)
    assert [new.nearest_index(float(torque)) for torque in grid.astype(np.float32)] == list(
        range(41)
    )


def test_no_target_network_the_original_chases_its_own_values() -> None:
    for name in ("original", "walkthrough"):
        agent = Run(kp.preset(name)).agent
        assert agent.target is agent.online
    agent = Run(kp.preset("reference")).agent
    assert agent.target is not agent.online


def test_copying_a_networks_weights_to_itself_is_no_refresh() -> None:
    """The walkthrough's "sync"."""
    network = kp.DQN((8,), 41)
    before = network.get_weights()
    network.set_weights(network.get_weights())
    for ours, theirs in zip(before, network.get_weights(), strict=True):
        np.testing.assert_array_equal(ours, theirs)


def test_update_starvation_459_updates_are_not_enough_even_on_good_data(
    recorded_memory: ReplayBuffer,
) -> None:
    """All else as in `reference`: 459 updates leave a policy worse than chance, 2000 do not.

    A pendulum that hangs still loses π² a step, 10 π² in all under γ = 0.9: the value to find
    there is near -90, and 459 updates have hardly begun to carry it that far.
    """
    assert kp.preset("original").total_updates == 459
    assert kp.preset("reference").total_updates == 30 * 459
    hanging = np.array([[-1, 0, 0]], np.float32)
    random = np.random.RandomState(0)
    agent = Run(kp.preset("reference")).agent

    def learn(updates: int) -> tuple[float, float]:
        positions = random.randint(0, 100_000, (updates, 32))
        agent.update(recorded_memory.at(positions))
        value = float(agent.online(hanging).numpy().max())
        return value, kp.evaluate_policy(agent.online, episodes=10).mean_return

    value, mean_return = learn(459)
    assert value > -25
    assert mean_return < -600
    value, mean_return = learn(1541)
    assert value < -35
    assert mean_return > -300


def test_hard_coded_batch_the_old_loop_breaks_on_any_other_size() -> None:
    def old_targets(q: np.ndarray, actions: np.ndarray, values: np.ndarray) -> np.ndarray:
        targets = q.copy()
        for row in range(64):  # where the batch's own size is meant
            targets[row, actions[row]] = values[row]
        return targets

    def batch(size: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return np.zeros((size, 41)), np.zeros(size, int), np.ones(size)

    with pytest.raises(IndexError):
        old_targets(*batch(32))
    assert old_targets(*batch(128)).sum() == 64  # half of the batch is not learned from

    for size in (1, 32, 64, 128):
        agent = Run(kp.preset("reference", batch_size=size, hidden_units=(8,))).agent
        row = Transitions(
            np.ones((1, size, 3), np.float32),
            np.zeros((1, size), np.int32),
            np.full((1, size), -100, np.float32),
            np.ones((1, size, 3), np.float32),
            np.ones((1, size), bool),
        )
        q = agent.online(row.observation[0]).numpy()[0, 0]
        # Every row counts: the mean over rows of equal error is that error.
        assert agent.update(row)[0] == pytest.approx((100 + q) ** 2 / 41, rel=1e-5)


def test_unsaved_final_weights_the_last_10_episodes_are_kept(tmp_path: Path) -> None:
    assert [episode for episode in range(400) if episode % 10 == 0][-1] == 390  # of 399

    config = kp.preset("reference", episodes=46, hidden_units=(8,))
    result = kp.train_dqn(config, tmp_path)
    saved = kp.load_weights(tmp_path / "pendulum_weight.h5")
    for ours, theirs in zip(saved.get_weights(), result.network.get_weights(), strict=True):
        np.testing.assert_array_equal(ours, theirs)


def test_unseeded_the_old_program_starts_differently_each_time() -> None:
    def old_start() -> float:
        layer = keras.layers.Dense(8)
        layer.build((None, 3))
        observation, _ = gymnasium.make("Pendulum-v1", g=1.0).reset()
        return float(layer.kernel[0, 0] + observation[0])

    assert old_start() != old_start()

    def new_start() -> float:
        run = Run(kp.preset("reference", seed=3, episodes=1, hidden_units=(8,)))
        (record,) = run.episodes()
        return record.episode_return

    assert new_start() == new_start()
