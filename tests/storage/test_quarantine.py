"""Files are read in another process, and its answers are checked."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import psutil
import pytest
from numpy.typing import NDArray

import keras_pendulum as kp
from keras_pendulum.storage import quarantine
from keras_pendulum.storage.quarantine import LARGEST_ANSWER, H5File, open_h5

ARRAYS = {"a": np.arange(6, dtype=">f4").reshape(2, 3), "b/c": np.array(7, np.int64)}


def write_file(path: Path) -> Path:
    with h5py.File(path, "w") as file:
        for name, array in ARRAYS.items():
            file[name] = array
        file["b"].attrs["texts"] = ["x", "ü"]
        file["b"].attrs["bytes"] = np.bytes_("y")
        file["b"].attrs["number"] = np.float32(0.5)
        file["b"].attrs["no text"] = np.bytes_(b"\xff")
        file["b"].attrs["empty"] = h5py.Empty("f4")
    return path


def process_id() -> int:
    return quarantine._PROCESS[0]._process.pid


def test_open_h5_returns_attributes_and_arrays(tmp_path: Path) -> None:
    with open_h5(write_file(tmp_path / "a.h5")) as file:
        assert set(file) == {"a", "b/c"}
        assert "b" in file
        assert "c" not in file
        assert file.shapes == {"a": (2, 3), "b/c": ()}
        for name, array in ARRAYS.items():
            found = file.read(name)
            np.testing.assert_array_equal(found, array)
            assert found.dtype == array.dtype
        assert file.attributes["b"] == {
            "texts": ["x", "ü"],
            "bytes": "y",
            "number": 0.5,
            "no text": None,
            "empty": None,
        }


def test_missing_array_is_refused(tmp_path: Path) -> None:
    with (
        open_h5(write_file(tmp_path / "a.h5")) as file,
        pytest.raises(kp.WeightsError, match=r"a\.h5: has no array x"),
    ):
        file.read("x")


def test_file_that_is_cut_short_while_it_is_open_is_refused(tmp_path: Path) -> None:
    """HDF5 would return other numbers, without an error."""
    path = write_file(tmp_path / "a.h5")
    with h5py.File(path, "a") as file:
        file["long"] = np.ones(10_000)
    with (
        pytest.raises(kp.WeightsError, match=r"a\.h5: cannot be read, .*ends too early"),
        open_h5(path) as opened,
    ):
        os.truncate(path, path.stat().st_size - 40_000)
        opened.read("long")


def test_one_process_serves_all_files_and_is_replaced_when_it_ends(tmp_path: Path) -> None:
    path = write_file(tmp_path / "a.h5")
    ids = []
    for _ in range(2):
        with open_h5(path):
            ids.append(process_id())
    psutil.Process(process_id()).kill()
    with open_h5(path) as file:
        ids.append(process_id())
        assert file.read("b/c") == 7
    assert ids[0] == ids[1] != ids[2]


def test_interrupted_read_does_not_disturb_the_next(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_file(tmp_path / "a.h5")

    def interrupted(stream: Any, buffer: Any) -> None:
        raise KeyboardInterrupt

    with open_h5(path) as file:
        monkeypatch.setattr(quarantine, "_read_exactly", interrupted)
        with pytest.raises(KeyboardInterrupt):
            file.read("a")
        monkeypatch.undo()
    with open_h5(path) as file:
        assert file.read("b/c") == 7


def test_relative_path_belongs_to_the_present_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with open_h5(write_file(tmp_path / "a.h5")):
        pass
    (tmp_path / "folder").mkdir()
    write_file(tmp_path / "folder" / "b.h5")
    monkeypatch.chdir(tmp_path / "folder")
    with open_h5("b.h5") as file:
        assert file.read("b/c") == 7
    with pytest.raises(kp.WeightsError, match=r"^a\.h5: no such file"), open_h5("a.h5"):
        pass


def test_process_ends_with_its_parent(tmp_path: Path) -> None:
    path = write_file(tmp_path / "a.h5")
    code = (
        "import sys, psutil\n"
        "from keras_pendulum.storage import quarantine\n"
        "with quarantine.open_h5(sys.argv[1]):\n"
        "    print(quarantine._PROCESS[0]._process.pid, flush=True)\n"
        "    psutil.Process().kill()\n"
    )
    words = [sys.executable, "-c", code, str(path)]
    done = subprocess.run(words, capture_output=True, text=True, timeout=120, check=False)
    child = int(done.stdout)
    deadline = time.monotonic() + 60
    while psutil.pid_exists(child) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not psutil.pid_exists(child)


class FakeProcess:
    """A process that answers what a hostile file could make it answer."""

    def __init__(self, arrays: dict[str, Any], values: bytes = b"") -> None:
        self.content = {"attributes": {"": {}}, "arrays": arrays}
        self.values = values

    def ask(self, path: str, request: Any, seconds: float, array: Any = None) -> Any:
        if array is not None:
            array.reshape(-1).view(np.uint8)[:] = np.frombuffer(self.values, np.uint8)
        return self.content


@pytest.mark.parametrize(
    "described",
    [["|O", [1]], ["<U8", [1]], ["<f16", [1]], ["<f4", [-1]], ["<f4", [26]], ["<f4", [5, 6]]],
)
def test_answer_with_an_impossible_array_is_refused(described: list[Any]) -> None:
    process: Any = FakeProcess({"a": described})
    with pytest.raises(ValueError, match=r"has the type|declare"):
        H5File("a.h5", process, size=100)


def test_answer_as_large_as_the_file_is_accepted() -> None:
    process: Any = FakeProcess({"a": ["<f4", [25]]}, bytes(100))
    array: NDArray[Any] = H5File("a.h5", process, size=100).read("a")
    np.testing.assert_array_equal(array, np.zeros(25))


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e39])
def test_answer_that_is_not_finite_is_refused(value: float) -> None:
    process: Any = FakeProcess({"a": ["<f8", [2]]}, np.array([1, value]).tobytes())
    file = H5File("a.h5", process, size=16)
    with pytest.raises(kp.WeightsError, match="a holds NaN or infinite numbers"):
        file.read("a")
    assert file.read("a", finite=False)[1] == value or np.isnan(value)


def test_too_many_attributes_are_refused(tmp_path: Path) -> None:
    """The answer has at most 1 MiB, exactly at its value and one byte beyond."""
    path = tmp_path / "a.h5"
    sizes = []
    for extra in (0, 1):
        with h5py.File(path, "w") as file:
            for name in map(str, range(20)):
                file.attrs[name] = np.bytes_(b"x" * 50_000)
            content = {"attributes": {"": dict.fromkeys(map(str, range(20)), "x" * 50000)}}
            overhead = len(json.dumps({**content, "arrays": {}})) + len(', "z": ""')
            file.attrs["z"] = np.bytes_(b"x" * (LARGEST_ANSWER - overhead + extra))
        try:
            with open_h5(path) as opened:
                sizes.append(len(opened.attributes[""]["z"]))
        except kp.WeightsError as error:
            assert "too many names and attributes" in str(error)
            sizes.append(0)
    assert sizes[0] > 0
    assert sizes[1] == 0
