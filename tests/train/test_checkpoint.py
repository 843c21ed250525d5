"""A resumed run equals a run that was never stopped; a wrong checkpoint is refused."""

from __future__ import annotations

import json
import re
import shutil
import threading
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from conftest import assert_same

import keras_pendulum as kp
from keras_pendulum.config.config import Config
from keras_pendulum.config.settings import RENAMED
from keras_pendulum.storage.recorded_run import load_recorded_run
from keras_pendulum.train.checkpoint import (
    CheckpointWriter,
    load_checkpoint,
    save_checkpoint,
)
from keras_pendulum.train.loop import train_episodes
from keras_pendulum.train.run import make_run


@pytest.mark.parametrize(
    ("name", "average_updates"),
    [("original", 1), ("reference", 1), ("reference", 100), ("cartpole-original", 1)],
)
def test_resumed_run_equals_an_uninterrupted_run(
    name: str, average_updates: int, tmp_path: Path
) -> None:
    # A small replay buffer, so that old transitions are replaced during the run.
    size = 300 if "cartpole" in name else 3000
    config = kp.preset(name, episodes=50, replay_capacity=size, average_updates=average_updates)
    uninterrupted = kp.train_dqn(config, tmp_path / "uninterrupted")
    assert uninterrupted.history[-1].environment_steps > config.replay_capacity
    for last in (5, 45):
        episodes: list[int] = []

        def listen(record: Any, episodes: list[int] = episodes) -> None:
            episodes.append(record.episode)

        def should_stop(last: int = last, episodes: list[int] = episodes) -> bool:
            return episodes[-1] == last

        stopped = kp.train_dqn(
            config,
            tmp_path / "resumed",
            resume=last > 5,
            listeners=[listen],
            should_stop=should_stop,
        )
        assert not stopped.finished
        assert not (tmp_path / "resumed" / "rewards.png").exists()
        assert stopped.history[-1].updates == uninterrupted.history[last].updates
    resumed = kp.train_dqn(config, tmp_path / "resumed", resume=True)
    assert resumed.finished
    assert (tmp_path / "resumed" / "rewards.png").exists()
    assert_same(resumed, uninterrupted)
    rows = {
        name: [
            line.rsplit(",", 1)[0]  # without the seconds
            for line in (tmp_path / name / "history.csv").read_text().splitlines()
        ]
        for name in ("resumed", "uninterrupted")
    }
    assert rows["resumed"] == rows["uninterrupted"]


def test_run_killed_in_its_first_episode_replaces_the_old_run_and_can_be_resumed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class KilledError(Exception):
        pass

    def kill(*parts: object) -> int:
        raise KilledError

    kp.train_dqn(kp.preset("original", seed=9, episodes=2, hidden_units=(8,)), tmp_path)
    config = kp.preset("original", episodes=3, hidden_units=(8,))
    with monkeypatch.context() as patched:
        patched.setattr("keras_pendulum.dqn.agent.Agent.select_action", kill)
        with pytest.raises(KilledError):
            kp.train_dqn(config, tmp_path, overwrite=True)
    assert not (tmp_path / "rewards.png").exists()  # the picture of the old run
    assert load_recorded_run(tmp_path / "pendulum_weight.h5").config == config
    assert_same(kp.train_dqn(config, tmp_path, resume=True), kp.train_dqn(config))


def test_finished_run_can_be_extended(tmp_path: Path) -> None:
    config = kp.preset("original", hidden_units=(8,), episodes=44)
    kp.train_dqn(config, tmp_path)
    longer = kp.preset("original", hidden_units=(8,), episodes=48)
    assert_same(kp.train_dqn(longer, tmp_path, resume=True), kp.train_dqn(longer))


def test_extended_run_continues_from_the_averaged_weights(tmp_path: Path) -> None:
    config = kp.preset("original", hidden_units=(8,), episodes=44, average_updates=3)
    averaged = kp.train_dqn(config, tmp_path).network.get_weights()
    run = load_checkpoint(tmp_path / "pendulum_weight.h5", replace(config, episodes=48))
    for found, expected in zip(run.agent.online.get_weights(), averaged, strict=True):
        np.testing.assert_array_equal(found, expected)


def test_learning_rate_of_an_extended_run_follows_the_longer_cosine(tmp_path: Path) -> None:
    config = kp.preset("reference", hidden_units=(8,), episodes=44)
    before = kp.train_dqn(config, tmp_path).network.get_weights()
    longer = kp.preset("reference", hidden_units=(8,), episodes=48)
    result = kp.train_dqn(longer, tmp_path, resume=True)
    assert result.history[-1].updates == longer.total_updates
    after = result.network.get_weights()
    assert any((new != old).any() for new, old in zip(after, before, strict=True))


@pytest.fixture(scope="module")
def run_of_one_episode(tmp_path_factory: pytest.TempPathFactory) -> tuple[Config, Path]:
    config = kp.preset("original", episodes=1, hidden_units=(8,))
    folder = tmp_path_factory.mktemp("run")
    kp.train_dqn(config, folder)
    return config, folder


OTHER_VALUES: dict[str, Any] = {
    "preset": "mine",
    "environment": "CartPole-v1",
    "gravity": 3.0,
    "max_episode_steps": 199,
    "seed": 1,
    "hidden_units": (9,),
    "activation": "relu",
    "initial_weights": "fan-in",
    "torque_count": 5,
    "replay_capacity": 7999,
    "batch_size": 31,
    "discount": 0.8,
    "reward_scale": 0.5,
    "double_q": True,
    "loss": "huber",
    "epsilon_schedule": "steps",
    "epsilon_start": 0.8,
    "epsilon_decay": 0.98,
    "epsilon_decay_steps": 999.0,
    "epsilon_min": 0.02,
    "train_frequency": "step",
    "warmup_episodes": 39,
    "updates_per_episode": 2,
    "optimizer": "adamw",
    "optimizer_epsilon": 1e-8,
    "weight_decay": 0.01,
    "gradient_clip": 100.0,
    "learning_rate": 2e-3,
    "learning_rate_schedule": "cosine",
    "learning_rate_min": 1e-4,
    "average_updates": 9,
    "target_update": "soft",
    "tau": 0.2,
    "target_period": 199,
    "stored_index": "truncated",
}


CHANGEABLE = ("episodes", "save_every", "evaluate_every", "keep_best", "snapshots")
# The settings without which another one of a run has no effect.
NEEDED = {
    "epsilon_decay_steps": {"epsilon_schedule": "steps"},
    "weight_decay": {"optimizer": "adamw"},
    "learning_rate_min": {"learning_rate_schedule": "cosine"},
    "double_q": {"target_update": "soft"},
    "tau": {"target_update": "soft"},
    "target_period": {"target_update": "hard"},
}


def replace_settings(checkpoint: Path, **changes: Any) -> None:
    """Changes the settings that a checkpoint records."""
    with h5py.File(checkpoint, "r+") as file:
        state = json.loads(file["run/state"][()].tobytes())
        state["config"] |= changes
        replace_entry(file, "run/state", np.frombuffer(json.dumps(state).encode(), np.uint8))


@pytest.mark.parametrize(
    "name", [spec.name for spec in fields(Config) if spec.name not in CHANGEABLE]
)
def test_resuming_with_another_setting_raises_and_names_it(
    name: str, run_of_one_episode: tuple[Config, Path], tmp_path: Path
) -> None:
    config, folder = run_of_one_episode
    checkpoint = Path(shutil.copy(folder / "pendulum_weight.h5", tmp_path))
    needed = NEEDED.get(name, {})
    replace_settings(checkpoint, **needed)
    config = config.change(**needed)
    message = f"this run has {name} {getattr(config, name)}, not {OTHER_VALUES[name]}: "
    with pytest.raises(kp.ConfigError, match=re.escape(message)):
        load_checkpoint(checkpoint, config.change(**{name: OTHER_VALUES[name]}))


def test_run_of_an_older_version_with_a_setting_that_has_no_effect_is_resumed(
    run_of_one_episode: tuple[Config, Path], tmp_path: Path
) -> None:
    config, folder = run_of_one_episode
    old = Path(shutil.copytree(folder, tmp_path / "old"))
    replace_settings(old / "pendulum_weight.h5", tau=0.5, target_period=7, keep_best=True)
    assert load_recorded_run(old / "pendulum_weight.h5").config == config
    longer = config.change(episodes=2)
    assert_same(kp.train_dqn(longer, old, resume=True), kp.train_dqn(longer))


def test_resumed_run_can_be_saved_and_evaluated_at_other_episodes(
    run_of_one_episode: tuple[Config, Path],
) -> None:
    config, folder = run_of_one_episode
    other = replace(config, save_every=3, episodes=2, evaluate_every=2, keep_best=True, snapshots=2)
    assert load_checkpoint(folder / "pendulum_weight.h5", other).config == other


def replace_entry(file: h5py.File, name: str, array: Any) -> None:
    """Replaces an entry of the file by an array, or by a group where `array` is None."""
    del file[name]
    if array is None:
        file.create_group(name)
    else:
        file[name] = array


def replace_layers(file: h5py.File) -> None:
    replace_entry(file, "dense/dense/kernel:0", np.zeros((3, 9), np.float32))
    replace_entry(file, "dense/dense/bias:0", np.zeros(9, np.float32))
    replace_entry(file, "dense_1/dense_1/kernel:0", np.zeros((9, 41), np.float32))


MOMENTUM = "adam.dqn_head_bias_momentum"  # [41]
CHECKPOINT_DAMAGE: dict[str, tuple[Callable[[h5py.File], None], str]] = {
    "no state": (lambda file: file["run"].__delitem__("state"), "damaged"),
    "no history": (lambda file: file["run"].__delitem__("history"), "damaged"),
    "state is a group": (
        lambda file: replace_entry(file, "run/state", None),
        "has no array run/state",
    ),
    "state is not JSON": (
        lambda file: replace_entry(file, "run/state", np.zeros(50, np.uint8)),
        "damaged",
    ),
    "replay is an array": (lambda file: replace_entry(file, "replay", np.zeros(3)), "damaged"),
    "one reward": (
        lambda file: replace_entry(file, "replay/reward", np.zeros(1, np.float32)),
        "reward of 400 transitions has shape (1,)",
    ),
    "no rewards": (lambda file: file["replay"].__delitem__("reward"), "damaged"),
    "layers of another size": (
        replace_layers,
        "online/dqn/head/kernel is missing, unknown or of another shape",
    ),
    "no target": (lambda file: file.__delitem__("target"), "damaged"),
    "target of another shape": (
        lambda file: replace_entry(file, "target/dqn.head.bias", np.zeros(42, np.float32)),
        "target/dqn/head/bias is missing, unknown or of another shape",
    ),
    "no iteration": (
        lambda file: file["optimizer"].__delitem__("adam.iteration"),
        "optimizer/adam/iteration is missing, unknown or of another shape",
    ),
    "unknown optimizer variable": (
        lambda file: file["optimizer"].__setitem__("adamw.iteration", np.int64(1)),
        "optimizer/adamw/iteration is missing, unknown or of another shape",
    ),
    "one number as momentum": (
        lambda file: replace_entry(file, f"optimizer/{MOMENTUM}", np.float32(1)),
        "optimizer/adam/dqn_head_bias_momentum is missing, unknown or of another shape",
    ),
    "NaN in the optimizer": (
        lambda file: replace_entry(file, f"optimizer/{MOMENTUM}", np.full(41, np.nan, np.float32)),
        f"optimizer/{MOMENTUM} holds NaN or infinite numbers",
    ),
    "infinity in the target": (
        lambda file: file["target/dqn.head.bias"].__setitem__(0, np.inf),
        "target/dqn.head.bias holds NaN or infinite numbers",
    ),
}


@pytest.mark.parametrize("kind", CHECKPOINT_DAMAGE)
def test_damaged_checkpoint_is_refused_in_one_line_and_not_changed(
    kind: str, tmp_path: Path
) -> None:
    config = kp.preset("original", episodes=2, hidden_units=(8,))
    kp.train_dqn(config, tmp_path)
    damage, message = CHECKPOINT_DAMAGE[kind]
    with h5py.File(tmp_path / "pendulum_weight.h5", "r+") as file:
        damage(file)
    before = {file: file.read_bytes() for file in tmp_path.iterdir()}
    with pytest.raises(kp.WeightsError) as caught:
        kp.train_dqn(config, tmp_path, resume=True)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
    assert {file: file.read_bytes() for file in tmp_path.iterdir()} == before


def test_resumed_run_cannot_be_shorter_than_it_is(tmp_path: Path) -> None:
    kp.train_dqn(kp.preset("original", episodes=4, hidden_units=(8,)), tmp_path)
    before = {file: file.read_bytes() for file in tmp_path.iterdir()}
    with pytest.raises(kp.ConfigError, match="has 4 episodes already; episodes is 3, expected at"):
        kp.train_dqn(kp.preset("original", episodes=3, hidden_units=(8,)), tmp_path, resume=True)
    assert {file: file.read_bytes() for file in tmp_path.iterdir()} == before


def test_file_without_a_run_cannot_be_resumed(tmp_path: Path) -> None:
    kp.save_weights(kp.DQN((8,)), tmp_path / "pendulum_weight.h5")
    with pytest.raises(kp.WeightsError, match=r"weights without a run .* use --init"):
        kp.train_dqn(kp.preset("original"), tmp_path, resume=True)


@pytest.mark.parametrize("old_name", RENAMED)
def test_checkpoint_of_an_older_version_is_refused_and_its_weights_load(
    old_name: str, tmp_path: Path
) -> None:
    config = kp.preset("original", episodes=2, hidden_units=(8,))
    trained = kp.train_dqn(config, tmp_path / "old").network
    checkpoint = tmp_path / "old" / "pendulum_weight.h5"
    with h5py.File(checkpoint, "r+") as file:
        state = json.loads(file["run/state"][()].tobytes())
        del state["config"][RENAMED[old_name].split()[0]]
        state["config"][old_name] = "a value"
        replace_entry(file, "run/state", np.frombuffer(json.dumps(state).encode(), np.uint8))
    message = rf"older version .*the setting {old_name}\) and cannot be resumed; use --init"
    with pytest.raises(kp.WeightsError, match=message):
        load_recorded_run(checkpoint)
    with pytest.raises(kp.WeightsError, match=message):
        kp.train_dqn(config, tmp_path / "old", resume=True)
    loaded = kp.load_weights(checkpoint)
    for found, expected in zip(loaded.get_weights(), trained.get_weights(), strict=True):
        np.testing.assert_array_equal(found, expected)
    scores = [kp.evaluate_policy(network, episodes=1) for network in (loaded, trained)]
    assert scores[0].mean_return == scores[1].mean_return
    assert_same(
        kp.train_dqn(config, tmp_path / "new", init=loaded), kp.train_dqn(config, init=trained)
    )


def test_checkpoint_stores_each_variable_under_its_keras_path(tmp_path: Path) -> None:
    run = make_run(kp.preset("reference", episodes=42, hidden_units=(8,), updates_per_episode=3))
    list(train_episodes(run))
    save_checkpoint(run, tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5") as file:
        layers = [
            f"{layer}.{array}" for layer in ("hidden_0", "head") for array in ("kernel", "bias")
        ]
        assert set(file["target"]) == {f"dqn.{name}" for name in layers}
        assert set(file["optimizer"]) == {
            "adam.iteration",
            *(
                f"adam.dqn_{name.replace('.', '_')}_{moment}"
                for name in layers
                for moment in ("momentum", "velocity")
            ),
        }
        iteration = file["optimizer/adam.iteration"]
        assert (iteration.dtype, iteration.shape, iteration[()]) == (np.int64, (), 3)
        for variable in run.agent.target.weights:
            np.testing.assert_array_equal(
                file["target"][variable.path.replace("/", ".")][()], variable.numpy()
            )


def test_checkpoint_without_the_settings_of_evaluations_and_snapshots_is_resumed(
    tmp_path: Path,
) -> None:
    config = kp.preset("original", episodes=3, hidden_units=(8,))
    kp.train_dqn(replace(config, episodes=2), tmp_path)
    with h5py.File(tmp_path / "pendulum_weight.h5", "r+") as file:
        assert "evaluations" not in file["run"]
        state = json.loads(file["run/state"][()].tobytes())
        for name in ("evaluate_every", "keep_best", "snapshots"):
            del state["config"][name]
        replace_entry(file, "run/state", np.frombuffer(json.dumps(state).encode(), np.uint8))
    assert_same(kp.train_dqn(config, tmp_path, resume=True), kp.train_dqn(config))


def test_checkpoint_holds_the_evaluations(tmp_path: Path) -> None:
    config = kp.preset("original", episodes=3, hidden_units=(8,))
    run = make_run(config)
    list(train_episodes(run))
    run.history[1] = run.history[1]._replace(greedy_regret=0.1)
    save_checkpoint(run, tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5") as file:
        assert file["run/history"].shape == (3, 8)
        assert file["run/evaluations"][()].tolist() == [[1.0, 0.1]]
    np.testing.assert_array_equal(load_checkpoint(tmp_path / "a.h5", config).history, run.history)


def test_checkpoint_records_the_settings(tmp_path: Path) -> None:
    config = kp.preset("walkthrough", gravity=2.5, seed=9)
    save_checkpoint(make_run(config), tmp_path / "a.h5")
    assert load_recorded_run(tmp_path / "a.h5").config == config


def test_checkpoint_written_during_the_run_holds_the_state_at_save(tmp_path: Path) -> None:
    config = kp.preset("reference", episodes=46, hidden_units=(8,), replay_capacity=3000)
    run = make_run(config)
    episodes = train_episodes(run)
    for _ in range(44):
        next(episodes)
    save_checkpoint(run, tmp_path / "immediate.h5")
    with CheckpointWriter(tmp_path / "delayed.h5") as writer:
        run_finished = threading.Event()
        writer._thread.submit(run_finished.wait)
        writer.save(run)
        assert len(list(episodes)) == 2
        run_finished.set()
    immediate, delayed = (tmp_path / name for name in ("immediate.h5", "delayed.h5"))
    assert delayed.read_bytes() == immediate.read_bytes()


@pytest.mark.parametrize("part", ["online", "target", "optimizer"])
def test_save_checkpoint_refuses_numbers_that_are_not_finite(part: str, tmp_path: Path) -> None:
    run = make_run(kp.preset("reference", hidden_units=(8,)))
    save_checkpoint(run, tmp_path / "a.h5")
    before = (tmp_path / "a.h5").read_bytes()
    variables = getattr(run.agent, part).variables
    variables[-1].assign(np.full(variables[-1].shape, np.inf))
    with pytest.raises(kp.UserError, match="a weight is not finite"):
        save_checkpoint(run, tmp_path / "a.h5")
    assert (tmp_path / "a.h5").read_bytes() == before


def test_error_of_the_environment_is_not_reported_as_damage(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = kp.preset("original", episodes=1, hidden_units=(8,))
    kp.train_dqn(config, tmp_path)

    def no_window(*settings: object) -> None:
        raise RuntimeError("no window")

    monkeypatch.setattr("keras_pendulum.environments.task.Task.make_env", no_window)
    with pytest.raises(RuntimeError, match=r"^no window$"):
        load_checkpoint(tmp_path / "pendulum_weight.h5", config)


def test_checkpoint_of_other_versions_is_resumed_with_one_warning(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = kp.preset("original", episodes=2, hidden_units=(8,))
    kp.train_dqn(config, tmp_path)
    path = tmp_path / "pendulum_weight.h5"
    with h5py.File(path, "r+") as file:
        attributes = file["keras_pendulum"].attrs
        versions = {**json.loads(attributes["versions"]), "keras": "3.0.0", "numpy": "2.0.0"}
        attributes["versions"] = np.bytes_(json.dumps(versions))
        attributes["version"] = np.bytes_("0.0.1")
    monkeypatch.setenv("TF_NUM_INTRAOP_THREADS", "7")
    with pytest.warns(UserWarning) as caught:
        run = load_checkpoint(path, config)
    (message,) = (str(warning.message) for warning in caught)
    assert message.startswith(f"{path} was saved with keras_pendulum 0.0.1, keras 3.0.0, numpy 2.0")
    assert "TF_NUM_INTRAOP_THREADS 1; these differ now" in message
    assert len(run.history) == 2


@pytest.mark.filterwarnings("error")
def test_checkpoint_of_the_same_versions_is_resumed_without_warning(tmp_path: Path) -> None:
    config = kp.preset("original", episodes=2, hidden_units=(8,))
    kp.train_dqn(config, tmp_path)
    load_checkpoint(tmp_path / "pendulum_weight.h5", config)


def test_resume_of_a_folder_without_a_run_says_what_is_missing(tmp_path: Path) -> None:
    config = kp.preset("cartpole", hidden_units=(8,), episodes=1)
    with pytest.raises(kp.UserError, match=r"\(no pendulum_weight\.h5 or cartpole_weight\.h5\)"):
        kp.train_dqn(config, tmp_path / "missing", resume=True)
    assert not (tmp_path / "missing").exists()
    kp.save_weights(kp.DQN((8,)), tmp_path / "pendulum_weight.h5")  # of another environment
    with pytest.raises(kp.UserError, match=r"\(no cartpole_weight\.h5\): leave out --resume"):
        kp.train_dqn(config, tmp_path, resume=True)
