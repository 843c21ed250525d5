"""A small file is read only if it is still a regular one when it is open."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

from keras_pendulum.errors import UserError
from keras_pendulum.storage import small_files

if sys.platform == "win32":
    pytest.skip("needs pipes in folders", allow_module_level=True)


def test_pipe_that_took_the_place_of_a_checked_file_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "config.json"
    file.write_text("{}")
    check = small_files.require_regular

    def check_then_replace(path: Path) -> None:
        check(path)
        path.unlink()
        os.mkfifo(path)

    monkeypatch.setattr(small_files, "require_regular", check_then_replace)
    with pytest.raises(UserError, match="is a link, a folder or a device; expected a file"):
        small_files.read_small_file(file)
