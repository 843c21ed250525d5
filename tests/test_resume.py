"""A run that goes on from its checkpoint, or is told why it cannot."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import threading
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from conftest import assert_same, command_line

import keras_pendulum as kp
from keras_pendulum.checkpoint import (
    CheckpointWriter,
    load_checkpoint,
    load_config,
    save_checkpoint,
)
from keras_pendulum.config import Config
from keras_pendulum.run import Run


@pytest.mark.parametrize("name", ["original", "reference", "cartpole-original"])
def test_a_stopped_and_resumed_run_ends_like_one_never_stopped(name: str, tmp_path: Path) -> None:
    # A small buffer, so that its ring has wrapped round by then.
    config = kp.preset(name, episodes=50, replay_capacity=300 if "cartpole" in name else 3000)
    whole = kp.train_dqn(config, tmp_path / "whole")
    assert whole.history[-1].environment_steps > config.replay_capacity
    for last in (5, 45):
        reached: list[int] = []

        def listen(record: Any, reached: list[int] = reached) -> None:
            reached.append(record.episode)

        def should_stop(last: int = last, reached: list[int] = reached) -> bool:
            return reached[-1] == last

        stopped = kp.train_dqn(
            config,
            tmp_path / "parts",
            resume=last > 5,
            listeners=[listen],
            should_stop=should_stop,
        )
        assert not stopped.finished
        assert not (tmp_path / "parts" / "rewards.png").exists()
        assert stopped.history[-1].updates == whole.history[last].updates
    resumed = kp.train_dqn(config, tmp_path / "parts", resume=True)
    assert resumed.finished
    assert (tmp_path / "parts" / "rewards.png").exists()
    assert_same(resumed, whole)
    rows = [
        (tmp_path / part / "history.csv").read_text().splitlines() for part in ("whole", "parts")
    ]
    ours, theirs = ([line.rsplit(",", 1)[0] for line in lines] for lines in rows)
    assert ours == theirs


def test_control_c_saves_a_checkpoint_and_exits_130(tmp_path: Path) -> None:
    arguments = ["--preset", "original", "--seed", "5", "--out", str(tmp_path / "run")]
    with subprocess.Popen(
        command_line("train", *arguments, "--episodes", "100000"),
        cwd=tmp_path,
        env=os.environ,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        lines = []
        for line in process.stdout:
            lines.append(line)
            if line.startswith("Episode: 13,"):
                process.send_signal(signal.SIGINT)
    assert process.returncode == 130
    assert lines[-1].startswith("Go on: python -m keras_pendulum.train --resume")
    config = load_config(tmp_path / "run" / "pendulum_weight.h5")
    saved = load_checkpoint(tmp_path / "run" / "pendulum_weight.h5", config)
    printed = [line for line in lines if line.startswith("Episode: ")]
    assert [record.line() + "\n" for record in saved.history] == printed


def test_a_run_killed_in_its_first_episode_leaves_one_run_and_can_be_resumed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class KilledError(Exception):
        pass

    def kill(*parts: object) -> int:
        raise KilledError

    kp.train_dqn(kp.preset("original", seed=9, episodes=2, hidden_units=(8,)), tmp_path)
    config = kp.preset("original", episodes=3, hidden_units=(8,))
    with monkeypatch.context() as patched:
        patched.setattr("keras_pendulum.agent.Agent.select_action", kill)
        with pytest.raises(KilledError):
            kp.train_dqn(config, tmp_path, overwrite=True)
    assert not (tmp_path / "rewards.png").exists()  # it was the other run's
    assert load_config(tmp_path / "pendulum_weight.h5") == config
    assert_same(kp.train_dqn(config, tmp_path, resume=True), kp.train_dqn(config))


def test_a_finished_run_can_be_made_longer(tmp_path: Path) -> None:
    config = kp.preset("original", hidden_units=(8,), episodes=44)
    kp.train_dqn(config, tmp_path)
    longer = kp.preset("original", hidden_units=(8,), episodes=48)
    assert_same(kp.train_dqn(longer, tmp_path, resume=True), kp.train_dqn(longer))


def test_a_longer_run_of_an_annealed_rate_anneals_over_its_new_length(tmp_path: Path) -> None:
    config = kp.preset("reference", hidden_units=(8,), episodes=44)
    end = kp.train_dqn(config, tmp_path).network.get_weights()
    longer = kp.preset("reference", hidden_units=(8,), episodes=48)
    result = kp.train_dqn(longer, tmp_path, resume=True)
    assert result.history[-1].updates == longer.total_updates
    assert any(
        (ours != theirs).any()
        for ours, theirs in zip(result.network.get_weights(), end, strict=True)
    )


@pytest.fixture(scope="module")
def run_of_one_episode(tmp_path_factory: pytest.TempPathFactory) -> tuple[Config, Path]:
    config = kp.preset("original", episodes=1, hidden_units=(8,))
    folder = tmp_path_factory.mktemp("run")
    kp.train_dqn(config, folder)
    return config, folder


OTHER: dict[str, Any] = {
    "preset": "mine",
    "environment": "CartPole-v1",
    "gravity": 3.0,
    "episode_steps": 199,
    "seed": 1,
    "hidden_units": (9,),
    "activation": "relu",
    "initial_weights": "fan-in",
    "torque_count": 5,
    "replay_capacity": 7999,
    "batch_size": 31,
    "discount": 0.8,
    "reward_scale": 0.5,
    "bootstrap": "double",
    "loss": "huber",
    "epsilon_schedule": "steps",
    "epsilon_start": 0.8,
    "epsilon_decay": 0.98,
    "epsilon_decay_steps": 999.0,
    "epsilon_min": 0.02,
    "update_after": "reset",
    "learning_starts": 39,
    "updates_per_episode": 2,
    "optimizer": "adamw",
    "optimizer_epsilon": 1e-8,
    "weight_decay": 0.01,
    "gradient_clip": 100.0,
    "learning_rate": 2e-3,
    "learning_rate_schedule": "cosine",
    "target_update": "soft",
    "target_blend": 0.2,
    "target_period": 199,
    "remembered_action": "truncated",
}


@pytest.mark.parametrize(
    "name", [spec.name for spec in fields(Config) if spec.name not in ("episodes", "save_every")]
)
def test_resuming_with_another_setting_names_it(
    name: str, run_of_one_episode: tuple[Config, Path]
) -> None:
    config, folder = run_of_one_episode
    changes = {name: OTHER[name]}
    if name == "environment":
        changes["gravity"] = None  # CartPole has none
    told = f"this run has {name} {getattr(config, name)}, not {OTHER[name]}: "
    with pytest.raises(kp.ConfigError, match=re.escape(told)):
        load_checkpoint(folder / "pendulum_weight.h5", replace(config, **changes))


def test_a_run_can_be_resumed_to_be_saved_at_other_times(
    run_of_one_episode: tuple[Config, Path],
) -> None:
    config, folder = run_of_one_episode
    other = replace(config, save_every=3)
    assert load_checkpoint(folder / "pendulum_weight.h5", other).config == other


def replaced(file: h5py.File, name: str, array: Any) -> None:
    del file[name]
    if array is None:
        file.create_group(name)
    else:
        file[name] = array


CHECKPOINT_DAMAGE: dict[str, Callable[[h5py.File], None]] = {
    "no state": lambda file: file["run"].__delitem__("state"),
    "no history": lambda file: file["run"].__delitem__("history"),
    "state is a group": lambda file: replaced(file, "run/state", None),
    "replay is an array": lambda file: replaced(file, "replay", np.zeros(3)),
    "one reward for all": lambda file: replaced(file, "replay/reward", np.zeros(1, np.float32)),
    "no rewards": lambda file: file["replay"].__delitem__("reward"),
    "one number as optimizer state": lambda file: replaced(
        file, "optimizer/float32", np.float32(1)
    ),
    "too few optimizer variables": lambda file: file["optimizer"].__delitem__("int64"),
    "other target": lambda file: replaced(file, "target/float32", np.zeros(402, np.float32)),
    "not JSON": lambda file: replaced(file, "run/state", np.zeros(50, np.uint8)),
    "NaN in the optimizer": lambda file: replaced(
        file, "optimizer/float32", np.full(804, np.nan, np.float32)
    ),
}


@pytest.mark.parametrize("kind", CHECKPOINT_DAMAGE)
def test_a_damaged_checkpoint_is_told_in_one_line_and_left_alone(kind: str, tmp_path: Path) -> None:
    config = kp.preset("original", episodes=2, hidden_units=(8,))
    kp.train_dqn(config, tmp_path)
    with h5py.File(tmp_path / "pendulum_weight.h5", "r+") as file:
        CHECKPOINT_DAMAGE[kind](file)
    before = {file: file.read_bytes() for file in tmp_path.iterdir()}
    with pytest.raises(kp.WeightsError) as caught:
        kp.train_dqn(config, tmp_path, resume=True)
    assert "\n" not in str(caught.value)
    assert {file: file.read_bytes() for file in tmp_path.iterdir()} == before


def test_a_run_cannot_be_made_shorter_than_it_is(tmp_path: Path) -> None:
    kp.train_dqn(kp.preset("original", episodes=4, hidden_units=(8,)), tmp_path)
    before = {file: file.read_bytes() for file in tmp_path.iterdir()}
    with pytest.raises(kp.ConfigError, match="4 episodes behind it; episodes 3 cannot be its end"):
        kp.train_dqn(kp.preset("original", episodes=3, hidden_units=(8,)), tmp_path, resume=True)
    assert {file: file.read_bytes() for file in tmp_path.iterdir()} == before


def test_a_file_with_weights_alone_is_no_run_to_resume(tmp_path: Path) -> None:
    kp.save_weights(kp.DQN((8,)), tmp_path / "pendulum_weight.h5")
    with pytest.raises(kp.WeightsError, match="weights alone"):
        kp.train_dqn(kp.preset("original"), tmp_path, resume=True)


def test_a_run_that_an_older_version_saved_is_told_and_its_weights_load(tmp_path: Path) -> None:
    config = kp.preset("original", episodes=2, hidden_units=(8,))
    trained = kp.train_dqn(config, tmp_path).network
    checkpoint = tmp_path / "pendulum_weight.h5"
    with h5py.File(checkpoint, "r+") as file:
        del file["target"]
        for number, array in enumerate(trained.get_weights()):  # one array for each variable
            file[f"target/{number}"] = array
    with pytest.raises(kp.WeightsError, match=r"older version .* use --init"):
        kp.train_dqn(config, tmp_path, resume=True)
    for ours, theirs in zip(
        trained.get_weights(), kp.load_weights(checkpoint).get_weights(), strict=True
    ):
        np.testing.assert_array_equal(ours, theirs)


def test_a_checkpoint_records_the_runs_settings(tmp_path: Path) -> None:
    config = kp.preset("walkthrough", gravity=2.5, seed=9)
    save_checkpoint(Run(config), tmp_path / "a.h5")
    assert load_config(tmp_path / "a.h5") == config


def test_a_checkpoint_written_while_the_run_goes_on_is_of_where_it_was_begun(
    tmp_path: Path,
) -> None:
    run = Run(kp.preset("reference", episodes=46, hidden_units=(8,), replay_capacity=3000))
    episodes = run.episodes()
    for _ in range(44):
        next(episodes)
    save_checkpoint(run, tmp_path / "at once.h5")
    with CheckpointWriter(tmp_path / "later.h5") as writer:
        gone_on = threading.Event()
        writer._thread.submit(gone_on.wait)
        writer.save(run)
        assert len(list(episodes)) == 2
        gone_on.set()
    at_once, later = (tmp_path / name for name in ("at once.h5", "later.h5"))
    assert later.read_bytes() == at_once.read_bytes()


@pytest.mark.parametrize("part", ["online", "target", "optimizer"])
def test_what_is_not_finite_is_not_saved(part: str, tmp_path: Path) -> None:
    run = Run(kp.preset("reference", hidden_units=(8,)))
    save_checkpoint(run, tmp_path / "a.h5")
    before = (tmp_path / "a.h5").read_bytes()
    variables = getattr(run.agent, part).variables
    variables[-1].assign(np.full(variables[-1].shape, np.inf))
    with pytest.raises(kp.UserError, match="a weight is not finite"):
        save_checkpoint(run, tmp_path / "a.h5")
    assert (tmp_path / "a.h5").read_bytes() == before


def test_a_window_that_does_not_open_is_not_blamed_on_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = kp.preset("original", episodes=1, hidden_units=(8,))
    kp.train_dqn(config, tmp_path)

    def no_window(*settings: object) -> None:
        raise RuntimeError("no window")

    monkeypatch.setattr("keras_pendulum.run.make_environment", no_window)
    with pytest.raises(RuntimeError, match=r"^no window$"):
        load_checkpoint(tmp_path / "pendulum_weight.h5", config)
