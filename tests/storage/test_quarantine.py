"""Files are read in another process, and its output is checked."""

from __future__ import annotations

import io
import json
import os
import sys
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from numpy.typing import NDArray

import keras_pendulum as kp
from keras_pendulum.storage import quarantine
from keras_pendulum.storage.quarantine import H5File, open_h5

ARRAYS = {
    "a": np.arange(6, dtype=">f4").reshape(2, 3),
    "b/c": np.array(7, np.int64),
    "none": np.zeros((0, 3), np.float32),
}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for name, array in ARRAYS.items():
            file[name] = array
        file["b"].attrs["texts"] = ["x", "ü"]
        file["b"].attrs["bytes"] = np.bytes_("y")
        file["b"].attrs["number"] = np.float32(0.5)
        file["b"].attrs["no text"] = np.bytes_(b"\xff")
        file["b"].attrs["empty"] = h5py.Empty("f4")
    return tmp_path / "a.h5"


def test_open_h5_returns_attributes_and_arrays(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(path.parent)
    with open_h5(path.name) as file:
        assert "b" in file
        assert "c" not in file
        assert file.shapes == {"a": (2, 3), "b/c": (), "none": (0, 3)}
        for name, array in ARRAYS.items():
            found = file.read(name)
            np.testing.assert_array_equal(found, array)
            assert found.dtype == array.dtype
            assert found.flags.writeable
        assert file.attributes["b"] == {
            "texts": ["x", "ü"],
            "bytes": "y",
            "number": 0.5,
            "no text": None,
            "empty": None,
        }
        with pytest.raises(kp.WeightsError, match=r"^a\.h5: has no array x$"):
            file.read("x")


READERS = {
    "import os; os.abort()": r"damaged \(the process that read it ended with (SIGABRT|status)",
    "import os; os._exit(3)": r"damaged \(the process that read it ended with status 3\)",
    "import no_such_module": r"^[^:]*a\.h5: cannot be read \(.* does not start\)",
    "import time; time.sleep(600)": r"damaged \(reading it takes more than 0 s\)",
    "print('x' * 2**21)": "damaged",
    "print('[' * 2**19)": "damaged",
    "print('{}')": "damaged",
    "pass": "damaged",
}


@pytest.mark.parametrize("code", READERS)
def test_file_is_refused_in_one_line_when_its_reader_fails(
    code: str, path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(quarantine, "_READER", ("-c", code))
    if "sleep" in code:
        monkeypatch.setattr(quarantine, "_SECONDS_BY_THE_CLOCK", 0.2)
        monkeypatch.setattr(quarantine, "SECONDS", 0.1)
    with pytest.raises(kp.WeightsError, match=READERS[code]) as caught, open_h5(path):
        raise AssertionError
    assert str(path) in str(caught.value)
    assert str(caught.value).isprintable()


def test_missing_python_or_temporary_folder_is_one_line(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patch:
        patch.setattr(sys, "executable", str(path.parent / "no_python"))
        with pytest.raises(kp.WeightsError, match=r"cannot be read .*no_python"), open_h5(path):
            raise AssertionError
    monkeypatch.setattr("tempfile.tempdir", str(path.parent / "no_folder"))
    with pytest.raises(kp.WeightsError, match=r"cannot be read .*no_folder"), open_h5(path):
        raise AssertionError


def h5_file(arrays: dict[str, Any], values: bytes = b"", size: int = 100) -> H5File:
    """Returns the content of a file, from the output that its reader could have made."""
    description = {"attributes": {"": {}}, "arrays": arrays}
    output = json.dumps(description).encode() + b"\n" + values
    return H5File("a.h5", io.BytesIO(output), size)


@pytest.mark.parametrize(
    ("described", "values"),
    [
        *((each, bytes(4)) for each in (["|O", [1]], ["<U1", [1]], ["<f16", [1]], ["<f4", [-1]])),
        (["<f4", [25]], bytes(99)),
        (["<f4", [25]], bytes(101)),
        (["<f4", [26]], bytes(104)),  # more than the file has
        (["<f4", [2**40, 2**40]], bytes(100)),
    ],
)
def test_description_that_does_not_fit_is_refused(described: Any, values: bytes) -> None:
    with pytest.raises(ValueError, match=r"has the type|declare"):
        h5_file({"a": described}, values)


def test_arrays_as_large_as_the_file_are_accepted() -> None:
    file = h5_file({"a": ["<f4", [20]], "b": ["|u1", [20]]}, bytes(80) + b"\1" * 20)
    found: NDArray[Any] = file.read("b")
    np.testing.assert_array_equal(found, np.ones(20))


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e39])
def test_array_that_is_not_finite_is_refused(value: float) -> None:
    file = h5_file({"a": ["<f8", [2]]}, np.array([1, value]).tobytes())
    with pytest.raises(kp.WeightsError, match="a holds NaN or infinite numbers"):
        file.read("a")
    assert file.read("a", finite=False)[1] == value or np.isnan(value)


def test_file_of_1_gib_is_read_and_a_larger_one_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "sparse.h5"
    for size, message in {2**30: "not an HDF5 file", 2**30 + 1: "larger than 1 GiB"}.items():
        with open(path, "wb") as file:
            file.truncate(size)
        with pytest.raises(kp.WeightsError, match=message), open_h5(path):
            raise AssertionError
    os.truncate(path, 0)
    with pytest.raises(kp.WeightsError, match="the file is empty"), open_h5(path):
        raise AssertionError
