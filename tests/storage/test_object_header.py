"""Lengths of strings, read from the file's bytes without HDF5."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from keras_pendulum.storage.object_header import string_lengths


def lengths(path: Path, name: str = "/") -> list[int]:
    with h5py.File(path) as file:
        address = h5py.h5o.get_info(file[name].id).addr
    with open(path, "rb") as raw:
        return sorted(string_lengths(raw, address))


def test_string_lengths_returns_all_strings_of_a_long_header_and_nothing_else(
    tmp_path: Path,
) -> None:
    strings = ["a" * i for i in range(50)]
    with h5py.File(tmp_path / "a.h5", "w") as file:
        group = file.create_group("here")
        for i, string in enumerate(strings):
            group.attrs[f"string {i}"] = string
            group.attrs[f"number {i}"] = np.arange(i % 7)
        group.attrs["Übung"] = "ö"  # two bytes
        group.attrs["several"] = ["one", "three", ""]
        group.attrs["fixed"] = np.bytes_("of fixed length")
    expected = [*map(len, strings), 2, 3, 5, 0]
    assert lengths(tmp_path / "a.h5", "here") == sorted(expected)
    assert lengths(tmp_path / "a.h5") == []


def truncated(content: bytes) -> bytes:
    return content[:200]


def endless(content: bytes) -> bytes:
    """Returns a file with a header whose continuation is its own start."""
    with h5py.File.in_memory(content) as file:
        start = h5py.h5o.get_info(file["here"].id).addr + 16
    message = (0x10).to_bytes(2, "little") + (16).to_bytes(2, "little") + bytes(4)
    block = message + start.to_bytes(8, "little") + (24).to_bytes(8, "little")
    return content[:start] + block + content[start + len(block) :]


@pytest.mark.parametrize("damage", [truncated, endless])
def test_damaged_header_raises_value_error(damage: Any, tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file.create_group("here").attrs["text"] = "words"
        address = h5py.h5o.get_info(file["here"].id).addr
    path.write_bytes(damage(path.read_bytes()))
    with open(path, "rb") as raw, pytest.raises(ValueError, match="header"):
        list(string_lengths(raw, address))


def test_header_of_a_later_version_is_refused(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w", libver="latest") as file:
        file.attrs["text"] = "words"
    with pytest.raises(ValueError, match="another version"):
        lengths(tmp_path / "a.h5")
