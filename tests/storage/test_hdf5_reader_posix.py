"""The process that reads files limits itself, is apart from the terminal, and respects a lock."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import h5py
import pytest

import keras_pendulum as kp
from keras_pendulum.storage import quarantine
from keras_pendulum.storage.quarantine import open_h5

if sys.platform == "win32":
    pytest.skip("needs the limits, sessions and locks of POSIX", allow_module_level=True)

# The exit status, and the end of what Python prints.
EXCESSES = {
    "while True: pass": (-signal.SIGPROF, ""),
    "os.write(1, bytes(2**21)); os.write(1, b'x')": (1, "File too large"),
    "sys.exit(str(resource.getrlimit(resource.RLIMIT_CORE)))": (1, "(0, 0)"),
}
if sys.platform == "linux":
    EXCESSES["bytearray(2**26)"] = (1, "MemoryError")


@pytest.mark.parametrize("code", EXCESSES)
def test_reader_of_a_file_of_1_mib_has_limits(code: str, tmp_path: Path) -> None:
    program = (
        "import os, resource, sys\n"
        "from keras_pendulum.storage.hdf5_reader import _limit\n"
        f"_limit(2**20, 0.2)\n{code}\n"
    )
    with open(tmp_path / "output", "wb") as output:
        words = [sys.executable, "-c", program]
        done = subprocess.run(words, stdout=output, stderr=subprocess.PIPE, text=True, check=False)
    status, printed = EXCESSES[code]
    assert done.returncode == status
    assert done.stderr.rstrip().endswith(printed)


def test_reader_that_exceeds_its_processor_time_refuses_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a.h5").write_bytes(b"x")
    code = (
        "from keras_pendulum.storage.hdf5_reader import _limit\n_limit(1, 0.2)\nwhile True: pass\n"
    )
    monkeypatch.setattr(quarantine, "_READER", ("-c", code))
    message = "damaged .reading it takes more than 8 s of processor time"
    with pytest.raises(kp.WeightsError, match=message), open_h5(tmp_path / "a.h5"):
        raise AssertionError


def test_ctrl_c_in_the_terminal_does_not_reach_the_reader(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a.h5").write_bytes(b"x")
    code = "import json, os; print(json.dumps({'error': f'session {os.getsid(0)}'}))"
    monkeypatch.setattr(quarantine, "_READER", ("-c", code))
    with pytest.raises(kp.WeightsError, match="session") as caught, open_h5(tmp_path / "a.h5"):
        raise AssertionError
    assert int(str(caught.value).split()[-1]) != os.getsid(0)


def test_file_that_another_program_writes_is_not_called_damaged(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    with (
        h5py.File(path, "w"),
        pytest.raises(kp.WeightsError, match="another program has opened the file for writing"),
        open_h5(path),
    ):
        raise AssertionError
    with open_h5(path) as file:
        assert set(file.attributes) == {""}
