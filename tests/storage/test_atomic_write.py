"""A file that is being replaced is the whole old one or the whole new one, whatever happens."""

from __future__ import annotations

import errno
import os
import time
from pathlib import Path

import pytest

import keras_pendulum as kp
from keras_pendulum.storage import atomic_write
from keras_pendulum.storage.atomic_write import require_no_other_file, write_atomically


def test_file_of_another_kind_is_not_replaced(tmp_path: Path) -> None:
    for name, content in {"a.gif": b"GIF89a", "a.h5": b"\x89HDF", "empty": b""}.items():
        (tmp_path / name).write_bytes(content)
    for name in ("a.gif", "missing", "."):  # writing to a folder fails later
        require_no_other_file(tmp_path / name, b"GIF8", "a GIF")
    for name in ("a.h5", "empty"):
        with pytest.raises(kp.UserError, match=f"{name} holds something else than a GIF"):
            require_no_other_file(tmp_path / name, b"GIF8", "a GIF")


class Windows:
    """A file that another program has open, as Windows shows it for some attempts."""

    platform = "win32"

    def __init__(self, refusals: int, monkeypatch: pytest.MonkeyPatch) -> None:
        self.attempts = 0
        self.slept = 0.0
        self._refusals = refusals
        self._replace = os.replace
        monkeypatch.setattr(atomic_write, "sys", self)
        monkeypatch.setattr(os, "replace", self.replace)
        monkeypatch.setattr(time, "sleep", self.sleep)

    def replace(self, source: Path, target: Path) -> None:
        self.attempts += 1
        if self.attempts <= self._refusals:
            raise PermissionError(errno.EACCES, "Permission denied")
        self._replace(source, target)

    def sleep(self, seconds: float) -> None:
        self.slept += seconds


def test_file_that_windows_has_open_is_replaced_when_it_is_closed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a.csv").write_bytes(b"old")
    windows = Windows(refusals=40, monkeypatch=monkeypatch)
    write_atomically(tmp_path / "a.csv", b"new")
    assert {file.name: file.read_bytes() for file in tmp_path.iterdir()} == {"a.csv": b"new"}
    assert windows.attempts == 41
    assert windows.slept == pytest.approx(2.0)


def test_file_that_stays_open_on_windows_is_one_line_after_2_seconds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a.csv").write_bytes(b"old")
    windows = Windows(refusals=1000, monkeypatch=monkeypatch)
    with pytest.raises(kp.UserError, match=r"cannot write .*a\.csv: another program has the file"):
        write_atomically(tmp_path / "a.csv", b"new")
    assert {file.name: file.read_bytes() for file in tmp_path.iterdir()} == {"a.csv": b"old"}
    assert windows.slept == pytest.approx(2.0)


def test_refused_replacement_is_final_on_other_systems(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    windows = Windows(refusals=1000, monkeypatch=monkeypatch)
    windows.platform = "linux"
    with pytest.raises(kp.UserError, match=r"cannot write .*a\.csv: Permission denied"):
        write_atomically(tmp_path / "a.csv", b"new")
    assert (windows.attempts, windows.slept) == (1, 0.0)
    assert not list(tmp_path.iterdir())
