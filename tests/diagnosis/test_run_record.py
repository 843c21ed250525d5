from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from exact_agent import NOISE, diagnose_values, exact_values, measure

import keras_pendulum as kp
from keras_pendulum.config.config import Config
from keras_pendulum.diagnosis.motion import Motion
from keras_pendulum.diagnosis.run_record import RunRecord, read_record
from keras_pendulum.diagnosis.stored_transitions import StoredRewards
from keras_pendulum.dqn.replay_buffer import Transitions
from keras_pendulum.storage.run_folder import find_run


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> RunRecord:
    folder = tmp_path_factory.mktemp("run")
    config = kp.preset("reference", episodes=30, hidden_units=(8,), warmup_episodes=30)
    kp.train_dqn(config, folder)  # without an update
    return read_record(find_run(folder))


def settings(record: RunRecord) -> Config:
    assert record.config is not None
    return record.config


def changed(record: RunRecord, **fields: Any) -> RunRecord:
    return replace(record, replay=record.replay._replace(**fields))


def selected(record: RunRecord, rows: Any) -> RunRecord:
    return replace(record, replay=Transitions(*(array[rows] for array in record.replay)))


def stored_as(record: RunRecord, action: int, other: int) -> RunRecord:
    stored = record.replay.action
    return changed(record, action=np.where(stored == action, other, stored))


def trained(record: RunRecord, decay: float) -> RunRecord:
    """Returns the record of a run with enough updates, whose ε falls by a factor an episode."""
    history = [
        each._replace(epsilon=0.9 * decay**index, updates=9000)
        for index, each in enumerate(record.history)
    ]
    return replace(record, history=history)


def useless(observations: Any) -> Any:
    return exact_values(observations) * np.sin(20 * observations[:, :1])


def motion(record: RunRecord) -> Motion:
    return measure(useless, record).motion


def first(record: RunRecord) -> str:
    """Returns the first finding on a useless agent with this record."""
    return diagnose_values(useless, record).findings[0].name


def test_stored_transitions_of_a_run_obey_the_pendulum(record: RunRecord) -> None:
    assert motion(record).fit() == pytest.approx((1, 1), abs=0.01)
    rewards = StoredRewards(measure(useless, record), record)
    assert rewards.fit == pytest.approx((1, 0, 1), abs=1e-3)
    assert rewards.shifted_correlation < 0.9999
    assert not record.replay.terminated.any()
    assert record.steps == len(record.replay.action) == 30 * settings(record).max_episode_steps


def before(record: RunRecord, field: str) -> RunRecord:
    return changed(record, **{field: np.roll(getattr(record.replay, field), 1, axis=0)})


def with_several_steps(record: RunRecord, steps: int, sums: bool = True) -> RunRecord:
    """Returns transitions from a state to the one some steps later."""
    replay, left = record.replay, 1 - steps
    reward = replay.reward[:left].astype(float)
    for later in range(1, steps if sums else 1):
        reward += 0.9**later * replay.reward[later : left + later or None]
    return changed(
        record,
        observation=replay.observation[:left],
        action=replay.action[:left],
        reward=reward,
        next_observation=replay.next_observation[steps - 1 :],
        terminated=replay.terminated[:left],
    )


@pytest.mark.parametrize("steps", [2, 3, 5])
def test_rewards_and_states_of_several_steps_are_no_fault(record: RunRecord, steps: int) -> None:
    found = diagnose_values(useless, with_several_steps(record, steps)).findings
    names = {each.name for each in found}
    assert not names & {"misaligned-transitions", "other-reward", "torque-map", "reward-scale"}
    found = diagnose_values(useless, with_several_steps(record, steps, sums=False)).findings
    assert found[0].name == "misaligned-transitions"


def without_number(record: RunRecord, place: int) -> RunRecord:
    """Returns a record with one number of all observations stored as 0."""
    keep = (np.arange(3) != place).astype(np.float32)
    replay = record.replay
    return changed(
        record,
        observation=replay.observation * keep,
        next_observation=replay.next_observation * keep,
    )


@pytest.mark.parametrize(
    ("fault", "change"),
    [
        ("misaligned-transitions", lambda r: before(r, "next_observation")),
        ("misaligned-transitions", lambda r: before(r, "reward")),
        ("untrained-outputs", lambda r: selected(r, r.replay.action != 7)),
        ("observation-map", lambda r: without_number(r, 2)),
        ("exploration", lambda r: trained(r, 1.0)),
        ("forgetting", lambda r: trained(selected(r, slice(-1000, None)), 0.8)),
    ],
)
def test_changed_record_is_named(fault: str, change: Any, record: RunRecord) -> None:
    assert first(change(record)) == fault


@pytest.mark.parametrize(("action", "other"), [(3, 4), (39, 40), (0, 40)])
def test_action_stored_as_another_is_lost(record: RunRecord, action: int, other: int) -> None:
    assert motion(record).lost_actions() == []
    assert motion(stored_as(record, action, other)).lost_actions() == [action]
    assert first(stored_as(record, action, other)) == "untrained-outputs"


def test_lost_action_is_proven_in_a_small_buffer_of_one_action(record: RunRecord) -> None:
    rows = np.flatnonzero(record.replay.action == 39)  # the correlation of a constant is 0
    small = stored_as(selected(record, np.resize(rows, 300)), 39, 40)
    assert first(small) == "untrained-outputs"


def test_torques_between_the_outputs_lose_no_action(record: RunRecord) -> None:
    kept = selected(record, record.replay.action < 40)
    following = kept.replay.next_observation + np.array([0, 0, 0.01], np.float32)
    following[::2, 2] -= 0.02
    assert motion(changed(kept, next_observation=following)).lost_actions() == []


@pytest.mark.parametrize("stored", [240, 1000])
def test_transitions_off_by_one_lose_no_action(record: RunRecord, stored: int) -> None:
    last = selected(record, slice(-stored, None))
    shifted = changed(last, action=np.roll(last.replay.action, 1))
    assert motion(shifted).lost_actions() == []


def test_another_gravity_of_the_stored_transitions_is_named(record: RunRecord) -> None:
    finding = diagnose_values(useless, record, gravity=10.0).findings[0]
    assert finding.name == "other-gravity"
    assert finding.evidence == "stored transitions of a pendulum with g = 1.00"


def test_stored_transitions_exclude_another_gravity(record: RunRecord) -> None:
    def five(observations: Any) -> Any:
        return exact_values(observations, gravity=5.0)

    diagnosis = diagnose_values(five)
    assert (diagnosis.findings + diagnosis.notes)[0].name == "other-gravity"
    diagnosis = diagnose_values(five, record)
    assert "other-gravity" not in [each.name for each in diagnosis.findings + diagnosis.notes]


def test_few_recorded_updates_explain_small_values(record: RunRecord) -> None:
    def noisy(observations: Any) -> Any:
        value = exact_values(observations).mean(axis=1)[:, None]
        return 0.5 * value + np.sin(9 * observations @ NOISE)

    history = [each._replace(updates=500) for each in record.history]
    assert diagnose_values(noisy).findings[0].name != "too-few-updates"
    found = diagnose_values(noisy, replace(record, history=history)).findings
    assert found[0].name == "too-few-updates"
    assert found[0].evidence.endswith("after 500 updates")


def test_recorded_learning_rate_is_named_beside_another_fault(record: RunRecord) -> None:
    large = replace(record, config=replace(settings(record), learning_rate=0.05))
    terminal = changed(large, terminated=np.ones_like(record.replay.terminated))
    names = [finding.name for finding in diagnose_values(useless, terminal).findings]
    assert names[:2] == ["no-bootstrapping", "learning-rate"]
