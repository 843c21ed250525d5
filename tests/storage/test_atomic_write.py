"""A file that is being replaced is the whole old one or the whole new one, whatever happens."""

from __future__ import annotations

from pathlib import Path

import pytest

import keras_pendulum as kp
from keras_pendulum.storage.atomic_write import require_no_other_file, write_atomically


def test_missing_folder_raises(tmp_path: Path) -> None:
    with pytest.raises(kp.UserError, match=r"cannot write .*: No such file or directory"):
        write_atomically(tmp_path / "gone" / "a.h5", b"new")


def test_file_of_another_kind_is_not_replaced(tmp_path: Path) -> None:
    for name, content in {"a.gif": b"GIF89a", "a.h5": b"\x89HDF", "empty": b""}.items():
        (tmp_path / name).write_bytes(content)
    for name in ("a.gif", "missing", "."):  # writing to a folder fails later
        require_no_other_file(tmp_path / name, b"GIF8", "a GIF")
    for name in ("a.h5", "empty"):
        with pytest.raises(kp.UserError, match=f"{name} holds something else than a GIF"):
            require_no_other_file(tmp_path / name, b"GIF8", "a GIF")
