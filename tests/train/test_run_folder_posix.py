"""The folder of a run with links and pipes, and one that is moved during the run."""

from __future__ import annotations

import os
import sys
import threading
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from short_runs import SHORT, contents

import keras_pendulum as kp
from keras_pendulum.history import EpisodeRecord
from keras_pendulum.storage.atomic_write import write_atomically
from keras_pendulum.storage.run_folder import RunFolder
from keras_pendulum.train.checkpoint import load_checkpoint

if sys.platform == "win32":
    pytest.skip("needs links, pipes and moved folders", allow_module_level=True)

pytestmark = pytest.mark.usefixtures("short_ending")


@pytest.mark.parametrize("name", ["pendulum_weight.h5", "cartpole_weight.h5", "history.csv"])
def test_run_does_not_write_through_a_link(name: str, tmp_path: Path) -> None:
    config = kp.preset("original", episodes=2, **SHORT)
    kp.train_dqn(config, tmp_path / "run")
    target = tmp_path / "of another run"
    target.write_bytes(b"unchanged")
    (tmp_path / "run" / name).unlink(missing_ok=True)
    (tmp_path / "run" / name).symlink_to(target)
    before = {file: file.read_bytes() for file in tmp_path.rglob("*.*")}
    for overwrite, resume in ((True, False), (False, True), (False, False)):
        with pytest.raises(kp.UserError, match=f"run/{name} is a link, .*: remove it"):
            kp.train_dqn(config, tmp_path / "run", overwrite=overwrite, resume=resume)
    assert {file: file.read_bytes() for file in tmp_path.rglob("*.*")} == before
    assert target.read_bytes() == b"unchanged"


def test_pipe_in_place_of_a_file_of_the_run_is_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "history.csv")
    with pytest.raises(kp.UserError, match=r"history\.csv is a link, a folder or a device"):
        RunFolder(tmp_path, "Pendulum-v1")


def test_link_changed_during_a_run_does_not_change_its_folder(tmp_path: Path) -> None:
    best, new, latest = (tmp_path / name for name in ("best", "new", "latest"))
    config = kp.preset("original", episodes=12, **SHORT)
    kp.train_dqn(replace(config, seed=7), best)
    before = contents(best)
    new.mkdir()
    latest.symlink_to(new)

    def change_link(record: EpisodeRecord) -> None:
        if record.episode == 5:
            latest.unlink()
            latest.symlink_to(best)

    kp.train_dqn(config, latest, listeners=[change_link])
    assert contents(best) == before
    assert len(load_checkpoint(new / "pendulum_weight.h5", config).history) == 12


@pytest.mark.parametrize("writing", ["a checkpoint", "its history"])
def test_run_ends_when_its_folder_is_moved_and_does_not_write_in_the_new_one(
    writing: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, moved = tmp_path / "run", tmp_path / "moved"
    config = kp.preset("original", episodes=12, **SHORT)
    before: dict[Path, bytes] = {}
    write_started, folder_moved = threading.Event(), threading.Event()
    is_first = iter([True])

    def write(path: Path, *parts: bytes, **options: Any) -> None:
        if threading.current_thread() is not threading.main_thread() and next(is_first, False):
            write_started.set()
            assert writing != "a checkpoint" or folder_moved.wait(60)
        write_atomically(path, *parts, **options)

    def move(record: EpisodeRecord) -> None:
        if record.episode == (0 if writing == "a checkpoint" else 5):
            assert write_started.wait(60)
            folder.rename(moved)
            kp.train_dqn(replace(config, seed=7), folder)
            before.update(contents(folder))
            folder_moved.set()

    monkeypatch.setattr("keras_pendulum.storage.checksum.write_atomically", write)
    with pytest.raises(kp.UserError, match=r"run, or the file .lock in it, was moved, removed"):
        kp.train_dqn(config, folder, listeners=[move])
    assert len(before) == 4
    assert contents(folder) == before
    assert load_checkpoint(moved / "pendulum_weight.h5", config).config == config
