"""The lock on a folder: one holder at a time, who notices when the folder moves."""

from __future__ import annotations

import fcntl
from pathlib import Path

import pytest

import keras_pendulum as kp
from keras_pendulum.storage.folder_lock import lock_folder


def test_locked_folder_is_refused_until_the_lock_is_released(tmp_path: Path) -> None:
    with (
        lock_folder(tmp_path),
        pytest.raises(kp.UserError, match=f"^another run is writing in {tmp_path}: wait"),
        lock_folder(tmp_path),
    ):
        raise AssertionError("two locks")
    with lock_folder(tmp_path) as require_not_moved:
        require_not_moved()


def test_other_folders_stay_unlocked(tmp_path: Path) -> None:
    (tmp_path / "inside").mkdir()
    with lock_folder(tmp_path), lock_folder(tmp_path / "inside") as require_not_moved:
        require_not_moved()


def test_lock_is_released_after_an_error(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError), lock_folder(tmp_path):
        raise ZeroDivisionError
    with lock_folder(tmp_path):
        pass


@pytest.mark.parametrize("replaced", [False, True])
def test_moved_folder_is_refused(replaced: bool, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    folder.mkdir()
    with lock_folder(folder) as require_not_moved:
        require_not_moved()
        folder.rename(tmp_path / "moved")
        if replaced:
            folder.mkdir()
        with pytest.raises(kp.UserError, match=f"^{folder} was moved, removed or replaced: noth"):
            require_not_moved()


def test_missing_folder_is_refused(tmp_path: Path) -> None:
    message = f"^cannot read the folder {tmp_path / 'none'}: No such file or directory$"
    with pytest.raises(kp.UserError, match=message), lock_folder(tmp_path / "none"):
        pass


def test_file_system_without_locks_is_accepted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(descriptor: int, operation: int) -> None:
        raise OSError(95, "Operation not supported")

    monkeypatch.setattr(fcntl, "flock", refuse)
    with lock_folder(tmp_path) as require_not_moved:
        require_not_moved()
