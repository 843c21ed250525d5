"""Limits of the content of an HDF5 file. `test_hostile_files.py` has files beyond them."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import keras_pendulum as kp
from keras_pendulum.limits import LARGEST_DESCRIPTION
from keras_pendulum.storage.hdf5_reader import contents, copy_content


def copied(path: Path) -> bytes:
    """Returns what the reader writes for a file."""
    output = io.BytesIO()
    with open(path, "rb", buffering=0) as file:
        copy_content(file, path.stat().st_size, output)
    return output.getvalue()


def test_values_follow_the_description(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["b"] = np.array([1, 2], ">i2")
        file["a"] = np.float32(0)
    description, values = copied(tmp_path / "a.h5").split(b"\n", 1)
    arrays = json.loads(description)["arrays"]
    assert arrays == {"b": [">i2", [2]], "a": ["<f4", []]}
    assert values == b"".join({"b": b"\0\1\0\2", "a": bytes(4)}[name] for name in arrays)


def test_bytes_that_were_checked_are_those_that_are_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["a"] = np.frombuffer(b"checked", np.uint8)
    content = path.read_bytes()

    def verify(checked: bytes) -> None:
        assert checked == content
        path.write_bytes(content.replace(b"checked", b"changed"))

    monkeypatch.setattr("keras_pendulum.storage.checksum.verify", verify)
    assert copied(path).endswith(b"checked")


def test_too_many_attributes_are_refused(tmp_path: Path) -> None:
    """The description has at most 1 MiB, exactly at its value and one byte beyond."""
    path = tmp_path / "a.h5"
    names = [f"{i:02d}" for i in range(20)]
    with h5py.File(path, "w") as file:
        for name in names:
            file.attrs[name] = np.bytes_(b"x" * 50_000)
    missing = LARGEST_DESCRIPTION - len(copied(path)) - len(', "z": ""')
    for extra in (0, 1):
        with h5py.File(path, "r+") as file:
            file.attrs["z"] = np.bytes_(b"x" * (missing + extra))
        if extra:
            with pytest.raises(kp.WeightsError, match="too many names and attributes"):
                copied(path)
        else:
            assert len(copied(path)) == LARGEST_DESCRIPTION


def test_thousand_groups_and_arrays_are_accepted_and_one_more_is_refused(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for i in range(999):  # and the file itself
            file.create_group(str(i))
        assert len(contents(file, 1)["attributes"]) == 1000
        file.create_group("more")
        with pytest.raises(kp.WeightsError, match="more than 1000 groups and arrays"):
            contents(file, 1)


def test_attribute_of_64_kib_is_read_and_a_larger_one_is_none(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w", libver="latest") as file:
        file.attrs["largest"] = np.zeros(2**16, np.uint8)
        file.attrs["larger"] = np.zeros(2**16 + 1, np.uint8)
        attributes = contents(file, 1)["attributes"][""]
    assert attributes["largest"] == [0] * 2**16
    assert attributes["larger"] is None


def test_arrays_as_large_as_the_file_are_accepted_and_one_byte_more_is_refused(
    tmp_path: Path,
) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["a"] = np.zeros(60, np.uint8)
        file["b"] = np.zeros(40, np.uint8)
        assert contents(file, 100)["arrays"] == {"a": ["|u1", (60,)], "b": ["|u1", (40,)]}
        with pytest.raises(kp.WeightsError, match="declare 100 bytes; the file has 99"):
            contents(file, 99)


@pytest.mark.parametrize(
    "options",
    [
        {},  # no stored numbers: HDF5 would return zeros
        {"data": np.ones((2, 2)), "chunks": (2, 2)},  # its numbers may be behind a filter
    ],
)
def test_array_that_is_not_plain_is_refused(options: dict[str, Any], tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_dataset("a", (2, 2), "f4", **options)
        with pytest.raises(kp.WeightsError, match=r"a .* is not a plain array"):
            contents(file, 100)
