"""The process that reads files is killed, is stopped, and finds a locked file."""

from __future__ import annotations

import os
import signal
import sys
from pathlib import Path

import h5py
import pytest
from test_quarantine import process_id, write_file

import keras_pendulum as kp
from keras_pendulum.storage import quarantine
from keras_pendulum.storage.quarantine import open_h5

if sys.platform == "win32":
    pytest.skip("needs SIGKILL, SIGSTOP and the locks of POSIX", allow_module_level=True)


def test_process_that_ends_while_it_reads_refuses_the_file_alone(tmp_path: Path) -> None:
    path = write_file(tmp_path / "a.h5")
    with (
        pytest.raises(kp.WeightsError, match=r"a\.h5: cannot be read, .* ended with SIGKILL"),
        open_h5(path) as file,
    ):
        os.kill(process_id(), signal.SIGKILL)
        file.read("a")
    with open_h5(path) as file:
        assert file.read("b/c") == 7


def test_process_that_does_not_answer_in_time_is_ended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_file(tmp_path / "a.h5")
    monkeypatch.setattr(quarantine, "seconds_for", lambda size: 0.2)
    with (
        pytest.raises(kp.WeightsError, match="takes more than 0 s"),
        open_h5(path) as file,
    ):
        before = process_id()
        os.kill(before, signal.SIGSTOP)
        file.read("a")
    monkeypatch.undo()
    with open_h5(path):
        assert process_id() != before


def test_file_that_another_program_writes_is_not_called_damaged(tmp_path: Path) -> None:
    path = write_file(tmp_path / "a.h5")
    with (
        h5py.File(path, "r+"),
        pytest.raises(kp.WeightsError, match="another program has opened the file for writing"),
        open_h5(path),
    ):
        pass
    with open_h5(path) as file:
        assert file.read("b/c") == 7
