"""A file that is being replaced is the whole old one or the whole new one, whatever happens."""

from __future__ import annotations

import contextlib
import errno
import os
import time
from pathlib import Path
from types import SimpleNamespace

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


@pytest.mark.parametrize(
    ("platform", "refusals", "attempts", "message"),
    [
        ("win32", 40, 41, None),  # closed after 2 s
        ("win32", 1000, 41, "another program has the file"),
        ("linux", 1000, 1, "Permission denied"),
    ],
)
def test_file_that_another_program_has_open_is_replaced_within_2_seconds_on_windows(
    platform: str,
    refusals: int,
    attempts: int,
    message: str | None,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes(b"old")
    targets: list[Path] = []
    slept: list[float] = []
    really_replace = os.replace

    def replace(source: Path, target: Path) -> None:
        targets.append(target)
        if len(targets) <= refusals:
            raise PermissionError(errno.EACCES, "Permission denied")
        really_replace(source, target)

    monkeypatch.setattr(atomic_write, "sys", SimpleNamespace(platform=platform))
    monkeypatch.setattr(os, "replace", replace)
    monkeypatch.setattr(time, "sleep", slept.append)
    error = pytest.raises(kp.UserError, match=rf"cannot write .*a\.csv: {message}")
    with error if message else contextlib.nullcontext():
        write_atomically(path, b"new")
    assert targets == [path] * attempts
    assert sum(slept) == pytest.approx(0.05 * (attempts - 1))
    assert list(tmp_path.iterdir()) == [path]
    assert path.read_bytes() == (b"old" if message else b"new")
