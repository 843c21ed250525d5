"""The lock on a folder: one holder at a time, until it ends or is killed."""

from __future__ import annotations

import errno
import subprocess
from pathlib import Path

import pytest
from conftest import running_module

import keras_pendulum as kp
from keras_pendulum.storage.folder_lock import LOCK_FILE, lock_folder


def test_locked_folder_is_refused_until_the_lock_is_released(tmp_path: Path) -> None:
    with lock_folder(tmp_path):
        for _ in range(2):
            with (
                pytest.raises(kp.UserError, match=r"^another run is writing in .*: wait") as caught,
                lock_folder(tmp_path),
            ):
                raise AssertionError("two locks")
            assert str(tmp_path) in str(caught.value)
    with lock_folder(tmp_path) as require_not_moved:
        require_not_moved()


def test_lock_is_released_and_its_file_removed_after_an_error(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError), lock_folder(tmp_path):
        assert [file.name for file in tmp_path.iterdir()] == [LOCK_FILE]
        raise ZeroDivisionError
    assert list(tmp_path.iterdir()) == []
    with lock_folder(tmp_path):
        pass


# Locks the folder `sys.argv[1]` until it is killed.
LOCKING = """
import sys, time
from pathlib import Path
from keras_pendulum.storage.folder_lock import lock_folder

with lock_folder(Path(sys.argv[1])):
    print("locked", flush=True)
    time.sleep(600)
"""


def test_lock_of_another_process_holds_until_the_process_is_killed(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    folder.mkdir()
    (tmp_path / "locking.py").write_text(LOCKING, encoding="utf-8")
    with running_module("locking", folder, cwd=tmp_path, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stdout.readline().strip() == b"locked"
        with pytest.raises(kp.UserError, match="another run is writing"), lock_folder(folder):
            pass
        process.kill()
        process.wait()
    assert (folder / LOCK_FILE).exists()
    with lock_folder(folder) as require_not_moved:
        require_not_moved()
    assert list(folder.iterdir()) == []


def test_folder_at_the_place_of_the_lock_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / LOCK_FILE).mkdir()
    with pytest.raises(kp.UserError, match=r"^cannot write .*\.lock: "), lock_folder(tmp_path):
        pass
    assert (tmp_path / LOCK_FILE).is_dir()


@pytest.mark.parametrize("number", [errno.ENOSYS, errno.EOPNOTSUPP, errno.ENOLCK])
def test_file_system_without_locks_is_accepted(
    number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(descriptor: int, operation: int) -> None:
        raise OSError(number, "no locks")

    fcntl = pytest.importorskip("fcntl", reason="Windows has another lock")
    monkeypatch.setattr(fcntl, "flock", refuse)
    for _ in range(2):
        with lock_folder(tmp_path) as require_not_moved:
            require_not_moved()
            assert list(tmp_path.iterdir()) == []
