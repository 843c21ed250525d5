"""Tests of the wrapper that records a program's steps, and of its file."""

from __future__ import annotations

import copy
import os
import zipfile
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.envs.classic_control import PendulumEnv
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers import ClipAction, RescaleAction
from recorded_runs import record_run

import keras_pendulum as kp
from keras_pendulum.diagnosis import step_ring
from keras_pendulum.diagnosis.record_sources import steps_of
from keras_pendulum.diagnosis.recorded_steps import Steps, read_steps
from keras_pendulum.diagnosis.recorder import VectorRecorder
from keras_pendulum.environments.pendulum import Pendulum


def play(env: Any, actions: Any) -> list[Any]:
    """Plays with resets; returns the rows (s, a, r, s′, terminated, truncated, first) by hand."""
    rows: list[Any] = []
    observation, first = None, True
    for action in actions:
        if observation is None:
            (observation, _), first = env.reset(seed=1 if not rows else None), True
        following, reward, terminated, truncated, _ = env.step(action)
        rows.append((observation, action, reward, following, terminated, truncated, first))
        observation, first = (None if terminated or truncated else following), False
    return rows


def assert_same(steps: Steps, rows: list[Any]) -> None:
    for column, expected in zip(steps[:7], zip(*rows, strict=True), strict=True):
        assert np.array_equal(column, np.array(expected).reshape(column.shape).astype(column.dtype))


def test_recorder_stores_what_the_environment_returns_and_changes_nothing() -> None:
    actions = np.random.RandomState(0).uniform(-2, 2, (100, 1)).astype(np.float32)
    plain = play(gymnasium.make("Pendulum-v1", max_episode_steps=30), actions)
    env = kp.Recorder(gymnasium.make("Pendulum-v1", max_episode_steps=30))
    for row, expected in zip(play(env, actions), plain, strict=True):
        assert all(np.array_equal(a, b) for a, b in zip(row, expected, strict=True))
    assert_same(env.steps, plain)
    assert env.steps.total == 100 and env.steps.truncated.sum() == 3 and env.steps.first.sum() == 4
    assert isinstance(env, gymnasium.Wrapper) and isinstance(env.unwrapped, PendulumEnv)


def test_indices_and_other_tasks_are_recorded() -> None:
    env = kp.Recorder(gymnasium.make("CartPole-v1"))
    rows = play(env, [0, 1] * 60)
    assert_same(env.steps, rows)
    assert env.steps.action.dtype == np.int64 and env.steps.terminated.any()


def test_observation_that_the_environment_changes_later_is_copied() -> None:
    class Reused(gymnasium.ObservationWrapper[Any, Any, Any]):
        array = np.zeros(3, np.float32)

        def observation(self, observation: Any) -> Any:
            self.array[:] = observation
            return self.array

    env = kp.Recorder(Reused(gymnasium.make("Pendulum-v1")))
    env.reset(seed=0)
    for _ in range(3):
        env.step([2.0])
    assert len(np.unique(env.steps.observation, axis=0)) == 3
    assert np.array_equal(env.steps.observation[1:], env.steps.next_observation[:-1])


def test_early_reset_begins_an_episode() -> None:
    steps = record_run(episodes=3, steps=7).steps
    assert np.flatnonzero(steps.first).tolist() == [0, 7, 14]
    assert not steps.truncated.any()


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_vector_environments_are_recorded_one_after_the_other(mode: AutoresetMode) -> None:
    """Compares with the same environments one by one; an automatic reset is not a step."""
    envs: Any = gymnasium.make_vec(
        "Pendulum-v1", 2, max_episode_steps=20, vector_kwargs={"autoreset_mode": mode}
    )
    env = kp.Recorder(envs)
    assert isinstance(env, VectorRecorder) and isinstance(env, gymnasium.vector.VectorEnv)
    env.reset(seed=1)
    rows = 50
    for _ in range(rows):
        actions = np.array([[1.0], [-1.0]], np.float32)
        *_, truncated, _ = env.step(actions)
        if mode == AutoresetMode.DISABLED and truncated.any():
            env.reset(options={"reset_mask": truncated})
    steps = env.steps
    count = rows - 2 if mode == AutoresetMode.NEXT_STEP else rows
    assert steps.total == len(steps.reward) == 2 * count
    assert np.array_equal(steps.action, np.repeat([1.0, -1.0], count))
    for number in range(2):
        own = slice(number * count, (number + 1) * count)
        alone: Any = gymnasium.make("Pendulum-v1", max_episode_steps=20)
        alone.reset(seed=1 + number)
        plain = kp.Recorder(alone)
        plain.reset(seed=1 + number)
        for _ in range(20):
            plain.step(np.array([1.0 - 2 * number], np.float32))
        first = slice(own.start, own.start + 20)
        assert np.allclose(steps.next_observation[first], plain.steps.next_observation, atol=1e-6)
        assert np.flatnonzero(steps.first[own]).tolist() == [0, 20, 40]
        assert np.flatnonzero(steps.truncated[own]).tolist() == [19, 39]
        follows = (
            np.all(steps.observation[own][1:] == steps.next_observation[own][:-1], axis=1)
            | steps.first[own][1:]
        )
        assert follows.all()


def test_memory_is_bounded_and_the_last_steps_stay(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(step_ring, "LARGEST_RECORD", 60)
    steps = record_run(episodes=5, steps=20).steps
    whole = 5 * 20
    assert steps.total == whole and 50 < len(steps.reward) < 60
    monkeypatch.undo()
    expected = record_run(episodes=5, steps=20).steps
    for column, all_rows in zip(steps[:7], expected[:7], strict=True):
        assert np.array_equal(column, all_rows[-len(steps.reward) :])


@pytest.mark.parametrize(
    "space",
    [
        gymnasium.spaces.Box(0, 255, (84, 84, 3), np.uint8),
        gymnasium.spaces.Dict({"a": gymnasium.spaces.Discrete(2)}),
    ],
)
def test_other_observations_are_refused(space: Any) -> None:
    env = gymnasium.make("Pendulum-v1")
    env.observation_space = space
    with pytest.raises(kp.ConfigError, match="Recorder is for those of at most 64 numbers"):
        kp.Recorder(env)


def test_recorder_can_be_copied() -> None:
    env = record_run(episodes=1, steps=5)
    copied = copy.deepcopy(env)
    copied.step([0.0])
    assert (len(env.steps.reward), len(copied.steps.reward)) == (5, 6)


def test_file_has_the_steps(tmp_path: Path) -> None:
    env = record_run(episodes=2, steps=5)
    env.save(tmp_path / "run.npz")
    env.save(tmp_path / "run.npz")  # again
    for column, expected in zip(read_steps(str(tmp_path / "run.npz")), env.steps, strict=True):
        assert np.array_equal(column, expected) and column.dtype == expected.dtype


def test_save_refuses_nothing_and_other_files(tmp_path: Path) -> None:
    env = kp.Recorder(gymnasium.make("Pendulum-v1"))
    with pytest.raises(kp.UserError, match="no step yet"):
        env.save(tmp_path / "run.npz")
    code = tmp_path / "agent.py"
    code.write_text("x = 1\n")
    with pytest.raises(kp.UserError, match=r"something else than an [.]npz file"):
        record_run(episodes=1, steps=5).save(code)
    assert code.read_text() == "x = 1\n"


def columns(**changes: Any) -> dict[str, Any]:
    return record_run(episodes=1, steps=5).steps._asdict() | changes


@pytest.mark.parametrize(
    "changes",
    [
        {"reward": np.array(["a"] * 5)},
        {"reward": np.array([None] * 5)},  # a pickle
        {"reward": np.zeros(4, np.float32)},
        {"reward": np.full(5, np.nan, np.float32)},
        {"observation": np.zeros((5, 2), np.float32)},
        {"observation": np.zeros(15, np.float32)},
        {"first": np.zeros(5, np.int64)},
        {"total": np.zeros(5, np.int64)},
    ],
)
def test_damaged_file_is_refused_in_one_line(changes: dict[str, Any], tmp_path: Path) -> None:
    path = tmp_path / "run.npz"
    np.savez(path, **columns(**changes))
    with pytest.raises(kp.UserError) as caught:
        read_steps(str(path))
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)


def test_file_whose_header_declares_more_than_it_has_takes_no_memory(tmp_path: Path) -> None:
    path = tmp_path / "run.npz"
    np.savez(path, **columns())
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    header = b"'shape': (5,), }" + b" " * 12
    large = members["reward.npy"].replace(header, b"'shape': (999999999999,), }".ljust(len(header)))
    assert large != members["reward.npy"]
    for content in (large, b"\x93NUMPY\x01\x00" + b"\xff" * 200, b""):
        with zipfile.ZipFile(path, "w") as archive:
            for name, data in (members | {"reward.npy": content}).items():
                archive.writestr(name, data)
        with pytest.raises(kp.UserError, match="damaged"):
            read_steps(str(path))


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04", b"hello", bytes(1000)])
def test_other_files_are_refused(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "run.npz"
    path.write_bytes(content)
    with pytest.raises(kp.UserError, match=r"is not the file of a recorder.*recorder\.save"):
        read_steps(str(path))


def test_missing_files_pipes_and_other_objects_are_refused(tmp_path: Path) -> None:
    with pytest.raises(kp.UserError, match=r"cannot read .*: No such file"):
        steps_of(tmp_path / "nothing.npz", Pendulum())
    with pytest.raises(kp.UserError, match=r"cannot read|not a file"):
        steps_of(tmp_path, Pendulum())
    if hasattr(os, "mkfifo"):
        os.mkfifo(tmp_path / "pipe")
        with pytest.raises(kp.UserError, match="not a file"):
            steps_of(tmp_path / "pipe", Pendulum())
    with pytest.raises(TypeError, match=r"record is a dict; expected a kp\.Recorder"):
        steps_of({}, Pendulum())
    with pytest.raises(kp.UserError, match="has no step"):
        steps_of(kp.Recorder(gymnasium.make("Pendulum-v1")), Pendulum())
    cartpole = kp.Recorder(gymnasium.make("CartPole-v1"))
    play(cartpole, [0, 1])
    with pytest.raises(kp.ConfigError, match="observations of 4 numbers"):
        steps_of(cartpole, Pendulum())


class Discretised(gymnasium.ActionWrapper[Any, Any, Any]):
    """Takes an index of three torques, as a number or as an array of one."""

    def __init__(self, env: gymnasium.Env[Any, Any]) -> None:
        super().__init__(env)
        self.action_space = gymnasium.spaces.Discrete(3)

    def action(self, action: Any) -> Any:
        return np.atleast_1d(np.array([-2.0, 0.0, 2.0])[action])


class ArrayReward(gymnasium.RewardWrapper[Any, Any]):
    def reward(self, reward: Any) -> Any:
        return np.array([reward])


def rescaled(env: Any, low: float, high: float) -> gymnasium.Env[Any, Any]:
    return RescaleAction(env, np.float32(low), np.float32(high))


def pendulum() -> gymnasium.Env[Any, Any]:
    return gymnasium.make("Pendulum-v1", disable_env_checker=True)


@pytest.mark.parametrize(
    ("env", "action", "recorded"),
    [
        (Discretised(pendulum()), 2, 2),
        (Discretised(pendulum()), np.array([2]), 2),
        (Discretised(pendulum()), torch.tensor([2]), 2),
        (pendulum(), np.array([[0.5]]), 0.5),  # its observations are [3, 1]
        (ArrayReward(pendulum()), [0.5], 0.5),
        (rescaled(pendulum(), -1, 1), np.array([0.5], np.float32), 1.0),
        (rescaled(pendulum(), 0, 10), np.array([0.0], np.float32), -2.0),
        (ClipAction(pendulum()), [0.5], 0.5),
    ],
)
def test_recorder_takes_what_the_environment_takes(env: Any, action: Any, recorded: float) -> None:
    recorder = kp.Recorder(env)
    observation, _ = recorder.reset(seed=0)
    following, reward, *_ = recorder.step(action)
    steps = recorder.steps
    assert steps.action.tolist() == [recorded]
    assert steps.observation[0].tolist() == observation.tolist()
    assert steps.next_observation[0].tolist() == np.ravel(following).tolist()
    assert steps.reward == pytest.approx(np.ravel(reward))


def test_recorder_never_ends_a_program() -> None:
    class Odd(gymnasium.ObservationWrapper[Any, Any, Any]):
        def observation(self, observation: Any) -> Any:
            return np.zeros(7)

    env = kp.Recorder(Odd(gymnasium.make("Pendulum-v1")))
    env.reset(seed=0)
    env.step([0.0])
    assert np.isnan(env.steps.observation).all()


def test_actions_of_a_vector_environment_are_recorded_as_they_act() -> None:
    wrapped: Any = [lambda env: rescaled(env, -1, 1)]
    envs: Any = gymnasium.make_vec("Pendulum-v1", 2, wrappers=wrapped)
    env = kp.Recorder(envs)
    env.reset(seed=0)
    env.step(np.array([[0.5], [-1.0]], np.float32))
    assert env.steps.action.tolist() == [1.0, -2.0]


def test_reset_of_some_environments_begins_an_episode_of_these() -> None:
    envs: Any = gymnasium.make_vec(
        "CartPole-v1", 3, "sync", vector_kwargs={"autoreset_mode": AutoresetMode.DISABLED}
    )
    env: Any = kp.Recorder(envs)
    env.reset(seed=0)
    resets = 3
    for step in range(100):
        *_, ended, _, _ = env.step(np.array([0, 1, step % 2]))
        if ended.any():
            env.reset(options={"reset_mask": ended})
            resets += ended.sum() if step < 99 else 0
    assert resets > 20
    assert env.steps.first.sum() == resets


@pytest.mark.parametrize("other", ["Pendulum-v1", object()])
def test_recorder_needs_an_environment(other: Any) -> None:
    with pytest.raises(TypeError, match=r"expected an environment of Gymnasium: kp.Recorder\(gym"):
        kp.Recorder(other)


def test_recorder_is_found_below_other_wrappers() -> None:
    env = record_run(episodes=2, steps=5)
    assert len(steps_of(gymnasium.wrappers.TimeLimit(env, 50), Pendulum()).reward) == 10


def test_archive_of_another_program_is_not_replaced(tmp_path: Path) -> None:
    path = tmp_path / "mine.keras"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("config.json", "{}")
    before = path.read_bytes()
    with pytest.raises(kp.UserError, match="holds something else than recorded steps"):
        record_run(episodes=1, steps=5).save(path)
    assert path.read_bytes() == before
