"""A resumed run equals a run that was never stopped; a wrong checkpoint is refused."""

from __future__ import annotations

import json
import re
import shutil
import threading
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from conftest import assert_same
from short_runs import SHORT, KilledError, contents, kill_at_call

import keras_pendulum as kp
from keras_pendulum.config.config import Config
from keras_pendulum.config.settings import RENAMED
from keras_pendulum.dqn.agent import Agent
from keras_pendulum.history import EpisodeRecord
from keras_pendulum.storage.recorded_run import load_recorded_run
from keras_pendulum.train.checkpoint import (
    CheckpointWriter,
    load_checkpoint,
    save_checkpoint,
)
from keras_pendulum.train.loop import train_episodes
from keras_pendulum.train.run import make_run

pytestmark = pytest.mark.usefixtures("short_ending")


@pytest.mark.parametrize("name", ["original", "reference", "cartpole-original", "cartpole"])
def test_resumed_run_equals_an_uninterrupted_run(name: str, tmp_path: Path) -> None:
    config = kp.preset(name, hidden_units=(8,), episodes=22, replay_capacity=300)
    if config.train_frequency == "episode":
        config = config.change(warmup_episodes=8)
    uninterrupted = kp.train_dqn(config, tmp_path / "uninterrupted")
    # Old transitions are replaced during the run.
    assert uninterrupted.history[-1].environment_steps > config.replay_capacity
    records: list[EpisodeRecord] = []
    for last in (3, 17):
        stopped = kp.train_dqn(
            config,
            tmp_path / "resumed",
            resume=last > 3,
            listeners=[records.append],
            should_stop=lambda last=last: records[-1].episode == last,  # type: ignore[misc]
        )
        assert not stopped.finished
        assert not (tmp_path / "resumed" / "rewards.png").exists()
        assert stopped.history[-1].updates == uninterrupted.history[last].updates
    resumed = kp.train_dqn(config, tmp_path / "resumed", resume=True)
    assert resumed.finished
    assert (tmp_path / "resumed" / "rewards.png").exists()
    assert_same(resumed, uninterrupted)
    rows, expected = (
        [
            line.rsplit(",", 1)[0]  # without the seconds
            for line in (tmp_path / name / "history.csv").read_text().splitlines()
        ]
        for name in ("resumed", "uninterrupted")
    )
    assert rows == expected


def test_run_killed_in_its_first_episode_replaces_the_old_run_and_can_be_resumed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kp.train_dqn(kp.preset("original", seed=9, episodes=2, **SHORT), tmp_path)
    config = kp.preset("original", episodes=3, **SHORT)
    with monkeypatch.context() as patched:
        kill_at_call(Agent, "select_action", 1, patched)
        with pytest.raises(KilledError):
            kp.train_dqn(config, tmp_path, overwrite=True)
    assert not (tmp_path / "rewards.png").exists()  # the picture of the old run
    assert load_recorded_run(tmp_path / "pendulum_weight.h5").config == config
    assert_same(kp.train_dqn(config, tmp_path, resume=True), kp.train_dqn(config))


def test_finished_run_can_be_extended(tmp_path: Path) -> None:
    config = kp.preset("original", episodes=4, **SHORT)
    kp.train_dqn(config, tmp_path)
    longer = replace(config, episodes=6)
    assert_same(kp.train_dqn(longer, tmp_path, resume=True), kp.train_dqn(longer))


def test_extended_run_continues_from_the_averaged_weights_at_the_rate_of_the_longer_cosine(
    tmp_path: Path,
) -> None:
    config = kp.preset("reference", episodes=4, average_updates=3, **SHORT)
    averaged = kp.train_dqn(config, tmp_path).network.get_weights()
    run = load_checkpoint(tmp_path / "pendulum_weight.h5", replace(config, episodes=6))
    np.testing.assert_equal(run.agent.online.get_weights(), averaged)
    # Half of the longer run's updates are made.
    assert float(run.agent.optimizer.learning_rate) == pytest.approx(config.learning_rate / 2)


@pytest.fixture(scope="module")
def short_run(
    short_ending: None, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Config, kp.TrainingResult, Path]:
    """A run of two episodes, and its folder."""
    config = kp.preset("original", episodes=2, **SHORT)
    folder = tmp_path_factory.mktemp("run")
    return config, kp.train_dqn(config, folder), folder


@pytest.fixture
def copied_run(
    short_run: tuple[Config, kp.TrainingResult, Path], tmp_path: Path
) -> tuple[Config, Path]:
    """The settings of that run, and the checkpoint in a copy of its folder."""
    config, _, folder = short_run
    return config, Path(shutil.copytree(folder, tmp_path / "copy")) / "pendulum_weight.h5"


# Of each kind; test_config shows which settings are those of the learning.
OTHER_VALUES: dict[str, Any] = {
    "preset": "mine",
    "gravity": 3.0,
    "max_episode_steps": 199,
    "seed": 1,
    "hidden_units": (9,),
    "activation": "relu",
    "replay_capacity": 7999,
    "discount": 0.8,
    "optimizer": "adamw",
    "gradient_clip": 100.0,
    "learning_rate_schedule": "cosine",
    "stored_index": "truncated",
}


def replace_settings(checkpoint: Path, removed: Iterable[str] = (), **changes: Any) -> None:
    """Changes the settings that a checkpoint records."""
    with h5py.File(checkpoint, "r+") as file:
        state = json.loads(file["run/state"][()].tobytes())
        settings = {**state["config"], **changes}
        state["config"] = {name: settings[name] for name in settings.keys() - set(removed)}
        replace_entry(file, "run/state", np.frombuffer(json.dumps(state).encode(), np.uint8))


@pytest.mark.parametrize(("name", "other"), OTHER_VALUES.items())
def test_resuming_with_another_setting_raises_and_names_it(
    name: str, other: Any, copied_run: tuple[Config, Path]
) -> None:
    config, checkpoint = copied_run
    message = f"this run has {name} {getattr(config, name)}, not {other}: "
    with pytest.raises(kp.ConfigError, match=re.escape(message)):
        load_checkpoint(checkpoint, config.change(**{name: other}))


@pytest.mark.parametrize(
    ("changed", "removed"),
    [
        # Settings without an effect, and a file without the settings that came later.
        ({"tau": 0.5, "target_period": 7, "keep_best": True}, []),
        ({}, ["evaluate_every", "keep_best", "snapshots"]),
    ],
)
def test_run_of_an_older_version_is_resumed(
    changed: dict[str, Any], removed: list[str], copied_run: tuple[Config, Path]
) -> None:
    config, checkpoint = copied_run
    replace_settings(checkpoint, removed, **changed)
    assert load_recorded_run(checkpoint).config == config
    longer = config.change(episodes=3)
    assert_same(kp.train_dqn(longer, checkpoint.parent, resume=True), kp.train_dqn(longer))


def test_resumed_run_can_be_saved_and_evaluated_at_other_episodes(
    copied_run: tuple[Config, Path],
) -> None:
    config, checkpoint = copied_run
    other = replace(config, save_every=3, episodes=2, evaluate_every=2, keep_best=True, snapshots=2)
    assert load_checkpoint(checkpoint, other).config == other


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
        "reward of 40 transitions has shape (1,)",
    ),
    "layers of another size": (
        replace_layers,
        "its layers have [9, 41] units; its settings say [8, 41]",
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
    kind: str, copied_run: tuple[Config, Path]
) -> None:
    config, checkpoint = copied_run
    damage, message = CHECKPOINT_DAMAGE[kind]
    with h5py.File(checkpoint, "r+") as file:
        damage(file)
    before = contents(checkpoint.parent)
    with pytest.raises(kp.WeightsError) as caught:
        kp.train_dqn(config, checkpoint.parent, resume=True)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
    assert contents(checkpoint.parent) == before


def test_resumed_run_cannot_be_shorter_than_it_is(copied_run: tuple[Config, Path]) -> None:
    config, checkpoint = copied_run
    before = contents(checkpoint.parent)
    with pytest.raises(kp.ConfigError, match="has 2 episodes already; episodes is 1, expected at"):
        kp.train_dqn(replace(config, episodes=1), checkpoint.parent, resume=True)
    assert contents(checkpoint.parent) == before


def test_file_without_a_run_cannot_be_resumed(tmp_path: Path) -> None:
    kp.save_weights(kp.DQN((8,)), tmp_path / "pendulum_weight.h5")
    with pytest.raises(kp.WeightsError, match=r"weights without a run .* use --init"):
        kp.train_dqn(kp.preset("original"), tmp_path, resume=True)


def test_checkpoint_with_an_old_setting_is_refused_and_its_weights_load(
    short_run: tuple[Config, kp.TrainingResult, Path], copied_run: tuple[Config, Path]
) -> None:
    config, checkpoint = copied_run
    for old, new in RENAMED.items():
        shutil.copy(short_run[2] / checkpoint.name, checkpoint)
        replace_settings(checkpoint, [new.split()[0]], **{old: "a value"})
        message = rf"older version .*the setting {old}\) and cannot be resumed; use --init"
        with pytest.raises(kp.WeightsError, match=message):
            load_recorded_run(checkpoint)
    with pytest.raises(kp.WeightsError, match=message):
        kp.train_dqn(config, checkpoint.parent, resume=True)
    network = kp.load_weights(checkpoint)
    np.testing.assert_equal(network.get_weights(), short_run[1].network.get_weights())
    initialized = kp.train_dqn(config, init=network).network  # without an update
    np.testing.assert_equal(initialized.get_weights(), network.get_weights())


def test_checkpoint_stores_each_variable_under_its_keras_path(tmp_path: Path) -> None:
    run = make_run(kp.preset("reference", hidden_units=(8,), episodes=1, warmup_episodes=0))
    list(train_episodes(run))
    save_checkpoint(run, tmp_path / "a.h5")
    state = run.agent.get_state()
    assert state["optimizer"]["adam/iteration"] == 40
    with h5py.File(tmp_path / "a.h5") as file:
        for group in ("target", "optimizer"):
            found = {name.replace(".", "/"): array[()] for name, array in file[group].items()}
            assert found.keys() == state[group].keys()
            for name, array in found.items():
                np.testing.assert_array_equal(array, state[group][name])
                assert array.dtype == state[group][name].dtype


def test_checkpoint_holds_the_evaluations(tmp_path: Path) -> None:
    config = kp.preset("original", episodes=3, **SHORT)
    run = make_run(config)
    list(train_episodes(run))
    run.history[1] = run.history[1]._replace(greedy_regret=0.1)
    save_checkpoint(run, tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5") as file:
        assert file["run/history"].shape == (3, 8)
        assert file["run/evaluations"][()].tolist() == [[1.0, 0.1]]
    np.testing.assert_array_equal(load_checkpoint(tmp_path / "a.h5", config).history, run.history)


def test_checkpoint_written_during_the_run_holds_the_state_at_save(tmp_path: Path) -> None:
    run = make_run(kp.preset("reference", episodes=6, replay_capacity=70, **SHORT))
    episodes = train_episodes(run)
    for _ in range(4):
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
    copied_run: tuple[Config, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    config, checkpoint = copied_run

    def no_window(*settings: object) -> None:
        raise RuntimeError("no window")

    monkeypatch.setattr("keras_pendulum.environments.task.Task.make_env", no_window)
    with pytest.raises(RuntimeError, match=r"^no window$"):
        load_checkpoint(checkpoint, config)


def test_checkpoint_of_other_versions_is_resumed_with_one_warning(
    copied_run: tuple[Config, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    config, path = copied_run
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
def test_checkpoint_of_the_same_versions_is_resumed_without_warning(
    copied_run: tuple[Config, Path],
) -> None:
    load_checkpoint(copied_run[1], copied_run[0])


def test_resume_of_a_folder_without_a_run_says_what_is_missing(tmp_path: Path) -> None:
    config = kp.preset("cartpole", hidden_units=(8,), episodes=1)
    with pytest.raises(kp.UserError, match=r"\(no pendulum_weight\.h5 or cartpole_weight\.h5\)"):
        kp.train_dqn(config, tmp_path / "missing", resume=True)
    assert not (tmp_path / "missing").exists()
    kp.save_weights(kp.DQN((8,)), tmp_path / "pendulum_weight.h5")  # of another environment
    with pytest.raises(kp.UserError, match=r"\(no cartpole_weight\.h5\): leave out --resume"):
        kp.train_dqn(config, tmp_path, resume=True)
