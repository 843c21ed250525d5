from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from exact_agent import coarse_value, exact_values, subject

import keras_pendulum as kp
from keras_pendulum.diagnose import comparisons, measurement
from keras_pendulum.diagnose.diagnosis import diagnose_subject
from keras_pendulum.diagnose.run_folder import read_record
from keras_pendulum.diagnose.run_record import RunRecord
from keras_pendulum.errors import WeightsError
from keras_pendulum.optimum.dynamics import TORQUES

NOISE = np.random.RandomState(0).normal(size=(3, 41))


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> RunRecord:
    folder = tmp_path_factory.mktemp("run")
    kp.train_dqn(kp.preset("reference", episodes=30, hidden_units=(8, 8)), folder)
    return read_record(folder / "pendulum_weight.h5")


@pytest.fixture(autouse=True)
def _coarse_tables(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(measurement, "discounted_value", coarse_value)
    monkeypatch.setattr(comparisons, "other_value", coarse_value)


def changed(record: RunRecord, **fields: Any) -> RunRecord:
    return replace(record, replay=record.replay._replace(**fields))


def first(record: RunRecord) -> str:
    """Returns the first finding on a useless agent with this record."""
    agent = subject(lambda o: exact_values(o) * np.sin(20 * o[:, :1]))
    return diagnose_subject(agent, record).findings[0].name


def test_stored_transitions_of_a_run_obey_the_pendulum(record: RunRecord) -> None:
    assert record.motion_fit(TORQUES) == pytest.approx((1, 1), abs=0.01)
    assert record.reward_fit(TORQUES) == pytest.approx((1, 1), abs=1e-4)
    assert record.shifted_reward_fit(TORQUES) < 0.9999
    assert record.terminal == 0
    assert record.steps == len(record.replay.action) == 30 * record.config.max_episode_steps
    assert record.epsilons[0] == pytest.approx(0.891)


def test_negated_rewards_are_named(record: RunRecord) -> None:
    assert first(changed(record, reward=-record.replay.reward)) == "reward-sign"


def test_scaled_rewards_are_named(record: RunRecord) -> None:
    assert first(changed(record, reward=50 * record.replay.reward)) == "reward-scale"


def test_declared_reward_scale_is_no_fault(record: RunRecord) -> None:
    scaled = changed(record, reward=50 * record.replay.reward)
    scaled = replace(scaled, config=replace(record.config, reward_scale=50.0))
    assert scaled.reward_fit(TORQUES)[1] == pytest.approx(1, abs=1e-4)


def test_terminal_transitions_are_named(record: RunRecord) -> None:
    terminated = np.ones_like(record.replay.terminated)
    assert first(changed(record, terminated=terminated)) == "no-bootstrapping"


@pytest.mark.parametrize("field", ["action", "next_observation", "reward"])
def test_transitions_off_by_one_are_named(record: RunRecord, field: str) -> None:
    before = np.roll(getattr(record.replay, field), 1, axis=0)
    assert first(changed(record, **{field: before})) == "misaligned-transitions"


def test_actions_that_are_never_stored_are_named(record: RunRecord) -> None:
    kept = record.replay.action != 7
    fields = {name: array[kept] for name, array in record.replay._asdict().items()}
    assert first(changed(record, **fields)) == "untrained-outputs"


def merged(record: RunRecord, action: int) -> RunRecord:
    stored = record.replay.action
    return changed(record, action=np.where(stored == action, action + 1, stored))


@pytest.mark.parametrize("action", [3, 39])
def test_action_stored_as_another_is_lost(record: RunRecord, action: int) -> None:
    assert record.lost_actions(TORQUES) == []
    assert merged(record, action).lost_actions(TORQUES) == [action]
    assert first(merged(record, action)) == "untrained-outputs"


def test_lost_action_is_proven_in_a_small_buffer_of_one_action(record: RunRecord) -> None:
    kept = np.flatnonzero(record.replay.action == 39)  # the correlation of a constant is 0
    kept = np.resize(kept, 300)
    fields = {name: array[kept] for name, array in record.replay._asdict().items()}
    assert first(merged(changed(record, **fields), 39)) == "untrained-outputs"


def test_action_stored_as_a_distant_one_is_lost(record: RunRecord) -> None:
    stored = record.replay.action
    distant = changed(record, action=np.where(stored == 0, 40, stored))
    assert abs(distant.motion_fit(TORQUES)[0] - 1) > 0.001
    assert distant.lost_actions(TORQUES) == [0]


def test_torques_between_the_outputs_lose_no_action(record: RunRecord) -> None:
    kept = record.replay.action < 40
    fields = {name: array[kept] for name, array in record.replay._asdict().items()}
    fields["next_observation"] = fields["next_observation"] + np.array([0, 0, 0.01], np.float32)
    fields["next_observation"][::2, 2] -= 0.02
    assert changed(record, **fields).lost_actions(TORQUES) == []


@pytest.mark.parametrize("stored", [40, 1000])
def test_transitions_off_by_one_lose_no_action(record: RunRecord, stored: int) -> None:
    fields = {name: array[-stored:] for name, array in record.replay._asdict().items()}
    shifted = changed(record, **{**fields, "action": np.roll(fields["action"], 1)})
    assert shifted.lost_actions(TORQUES) == []


def test_epsilon_that_never_falls_is_named(record: RunRecord) -> None:
    history = [each._replace(epsilon=0.9, updates=9000) for each in record.history]
    assert first(replace(record, history=history)) == "exploration"


def test_small_buffer_is_named(record: RunRecord) -> None:
    fields = {name: array[-1000:] for name, array in record.replay._asdict().items()}
    history = [
        each._replace(epsilon=0.9 * 0.8**index, updates=9000)
        for index, each in enumerate(record.history)
    ]
    assert first(replace(changed(record, **fields), history=history)) == "forgetting"


def test_another_gravity_of_the_stored_transitions_is_named(record: RunRecord) -> None:
    agent = subject(lambda o: exact_values(o) * np.sin(20 * o[:, :1]), gravity=10.0)
    finding = diagnose_subject(agent, record).findings[0]
    assert finding.name == "other-gravity"
    assert finding.evidence == "stored transitions of a pendulum with g = 1.00"


def test_stored_transitions_exclude_another_gravity(record: RunRecord) -> None:
    two = subject(lambda o: exact_values(o, gravity=2.0))
    assert diagnose_subject(two).notes[0].name == "other-gravity"
    diagnosis = diagnose_subject(two, record)
    assert "other-gravity" not in [each.name for each in diagnosis.findings + diagnosis.notes]


def test_few_recorded_updates_explain_small_values(record: RunRecord) -> None:
    noisy = subject(lambda o: 0.5 * exact_values(o).mean(axis=1)[:, None] + np.sin(9 * o @ NOISE))
    history = [each._replace(updates=500) for each in record.history]
    assert diagnose_subject(noisy).findings[0].name != "too-few-updates"
    found = diagnose_subject(noisy, replace(record, history=history)).findings
    assert found[0].name == "too-few-updates"
    assert found[0].evidence.endswith("after 500 updates")


def test_recorded_learning_rate_is_named_beside_another_fault(record: RunRecord) -> None:
    large = replace(record, config=replace(record.config, learning_rate=0.05))
    terminal = changed(large, terminated=np.ones_like(record.replay.terminated))
    agent = subject(lambda o: exact_values(o) * np.sin(20 * o[:, :1]))
    names = [finding.name for finding in diagnose_subject(agent, terminal).findings]
    assert names[:2] == ["no-bootstrapping", "learning-rate"]


def test_weights_without_a_run_are_refused(tmp_path: Path) -> None:
    kp.save_weights(kp.DQN((8,)), tmp_path / "a.h5")
    with pytest.raises(WeightsError, match="without a run"):
        read_record(tmp_path / "a.h5")
