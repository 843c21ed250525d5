"""Snapshots of a run: which networks are kept, and that a resumed run keeps the same ones."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from conftest import Command, assert_same
from short_runs import SHORT, KilledError, kill_at_call

import keras_pendulum as kp
from keras_pendulum.config.config import Config
from keras_pendulum.storage.recorded_run import load_recorded_run
from keras_pendulum.storage.run_folder import RunFolder
from keras_pendulum.storage.snapshots import Snapshot, read_snapshots
from keras_pendulum.train.folder_files import SnapshotsFile

FILE = "pendulum_weight_snapshots.h5"
CONFIG = kp.preset("reference", episodes=12, snapshots=5, save_every=5, **SHORT)
# Its result, its folder, and its weights after each episode.
WholeRun = tuple[kp.TrainingResult, Path, dict[int, Any]]
pytestmark = pytest.mark.usefixtures("short_ending")


@pytest.fixture(scope="module")
def whole_run(short_ending: None, tmp_path_factory: pytest.TempPathFactory) -> WholeRun:
    """A run that is not interrupted."""
    folder = tmp_path_factory.mktemp("whole")
    weights: dict[int, Any] = {}
    config = replace(CONFIG, save_every=1)
    result = kp.train_dqn(
        config, folder, on_checkpoint=lambda dqn, i: weights.update({i + 1: dqn.get_weights()})
    )
    return result, folder, weights


def snapshots_in(folder: Path) -> list[Snapshot]:
    weights = folder / "pendulum_weight.h5"
    history = load_recorded_run(weights).history
    return read_snapshots(folder / FILE, kp.load_weights(weights), history)


def test_snapshots_are_the_networks_of_the_run(whole_run: WholeRun) -> None:
    result, folder, weights = whole_run
    found = snapshots_in(folder)
    assert [each.episodes for each in found] == [0, 3, 6, 9, 12]
    for each in found[1:]:
        expected = np.concatenate([array.ravel() for array in weights[each.episodes]])
        np.testing.assert_array_equal(each.weights, expected.astype(np.float16))
        assert each.average_reward == result.history[each.episodes - 1].average_reward
    assert (found[0].weights != found[1].weights).any()
    newest = kp.load_weights(folder / FILE)
    np.testing.assert_equal(newest.get_weights(), result.network.get_weights())


def test_snapshots_change_nothing_in_the_run(whole_run: WholeRun) -> None:
    assert_same(kp.train_dqn(replace(CONFIG, snapshots=0)), whole_run[0])


@pytest.mark.parametrize(
    ("owner", "name", "call"),
    [
        (RunFolder, "append", 5),  # after the snapshot of episode 3, before a checkpoint
        (SnapshotsFile, "_take_if_due", 1),  # before the initial network is kept
        # Before the snapshot after 6 episodes, with its checkpoint.
        (SnapshotsFile, "_take_if_due", 7),
    ],
)
def test_killed_and_resumed_run_leaves_the_same_file(
    owner: Any,
    name: str,
    call: int,
    whole_run: WholeRun,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with monkeypatch.context() as patched:
        kill_at_call(owner, name, call, patched)
        with pytest.raises(KilledError):
            kp.train_dqn(CONFIG, tmp_path)
    resumed = kp.train_dqn(replace(CONFIG, save_every=1), tmp_path, resume=True)
    assert_same(resumed, whole_run[0])
    with h5py.File(tmp_path / FILE) as found, h5py.File(whole_run[1] / FILE) as expected:
        for key in ("episodes", "average_reward", "weights"):
            np.testing.assert_array_equal(found["snapshots"][key], expected["snapshots"][key])


def test_extended_run_keeps_the_networks_nearest_to_the_new_spacing(tmp_path: Path) -> None:
    config = replace(CONFIG, episodes=4, warmup_episodes=41)
    kp.train_dqn(config, tmp_path)
    assert [each.episodes for each in snapshots_in(tmp_path)] == [0, 1, 2, 3, 4]
    kp.train_dqn(replace(config, episodes=8), tmp_path, resume=True)
    assert [each.episodes for each in snapshots_in(tmp_path)] == [0, 2, 4, 6, 8]
    kp.train_dqn(replace(config, episodes=9, snapshots=3), tmp_path, resume=True)
    assert [each.episodes for each in snapshots_in(tmp_path)] == [0, 4, 9]


def test_run_that_asks_later_for_snapshots_begins_with_its_present_network(tmp_path: Path) -> None:
    config = replace(CONFIG, episodes=2, snapshots=0, warmup_episodes=41)
    kp.train_dqn(config, tmp_path)
    assert not (tmp_path / FILE).exists()
    kp.train_dqn(replace(config, episodes=4, snapshots=3), tmp_path, resume=True)
    assert [each.episodes for each in snapshots_in(tmp_path)] == [2, 4]


def test_command_keeps_snapshots_and_names_their_page(in_process: Command, tmp_path: Path) -> None:
    words = ["--preset", "original", "--hidden-units", "8", "--episodes", "3", "--out", "my run"]
    done = in_process("train", *words, "--snapshots", "3", "--quiet")
    assert done.returncode == 0, done.stderr
    assert FILE in done.stdout
    assert re.search(
        r"Take it to a browser: python -m keras_pendulum\.page .my run.\n", done.stdout
    )
    assert [each.episodes for each in snapshots_in(tmp_path / "my run")] == [0, 2, 3]


def test_20_snapshots_of_the_default_network_have_at_most_8_mb(tmp_path: Path) -> None:
    config = Config(episodes=19, snapshots=20, max_episode_steps=10, warmup_episodes=41)
    kp.train_dqn(config, tmp_path)
    assert len(snapshots_in(tmp_path)) == 20
    assert (tmp_path / FILE).stat().st_size <= 8_000_000
