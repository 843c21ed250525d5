"""Limits of the content of an HDF5 file. `test_hostile_files.py` has files beyond them."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

import keras_pendulum as kp
from keras_pendulum.storage.h5_validation import contents
from keras_pendulum.storage.quarantine import open_h5


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


def test_array_without_stored_numbers_is_refused(tmp_path: Path) -> None:
    """HDF5 would return zeros."""
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_dataset("a", (2, 2), "f4")
        with pytest.raises(kp.WeightsError, match=r"a .* is not a plain array"):
            contents(file, 100)


def test_file_of_1_gib_is_read_and_a_larger_one_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "sparse.h5"
    for size, message in {2**30: "not an HDF5 file", 2**30 + 1: "larger than 1 GiB"}.items():
        with open(path, "wb") as file:
            file.truncate(size)
        with pytest.raises(kp.WeightsError, match=message), open_h5(path):
            pass
