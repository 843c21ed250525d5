"""Lengths of texts, read past HDF5 from the file's own bytes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from keras_pendulum.object_header import text_lengths


def lengths(path: Path, name: str = "/") -> list[int]:
    with h5py.File(path) as file:
        address = h5py.h5o.get_info(file[name].id).addr
    with open(path, "rb") as raw:
        return sorted(text_lengths(raw, address))


def test_all_texts_of_a_long_header_are_found_and_nothing_else(tmp_path: Path) -> None:
    texts = ["a" * i for i in range(50)]
    with h5py.File(tmp_path / "a.h5", "w") as file:
        group = file.create_group("here")
        for i, text in enumerate(texts):
            group.attrs[f"text {i}"] = text
            group.attrs[f"number {i}"] = np.arange(i % 7)
        group.attrs["Übung"] = "ö"  # two bytes
        group.attrs["several"] = ["one", "three", ""]
        group.attrs["fixed"] = np.bytes_("of fixed length")
    expected = [*map(len, texts), 2, 3, 5, 0]
    assert lengths(tmp_path / "a.h5", "here") == sorted(expected)
    assert lengths(tmp_path / "a.h5") == []


def cut(content: bytes) -> bytes:
    return content[:200]


def endless(content: bytes) -> bytes:
    """A header that goes on at its own beginning."""
    with h5py.File.in_memory(content) as file:
        start = h5py.h5o.get_info(file["here"].id).addr + 16
    message = (0x10).to_bytes(2, "little") + (16).to_bytes(2, "little") + bytes(4)
    block = message + start.to_bytes(8, "little") + (24).to_bytes(8, "little")
    return content[:start] + block + content[start + len(block) :]


@pytest.mark.parametrize("damage", [cut, endless])
def test_a_damaged_header_ends_in_an_error(damage: Any, tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file.create_group("here").attrs["text"] = "words"
        address = h5py.h5o.get_info(file["here"].id).addr
    path.write_bytes(damage(path.read_bytes()))
    with open(path, "rb") as raw, pytest.raises(ValueError, match="header"):
        list(text_lengths(raw, address))


def test_headers_of_hdf5s_later_kind_are_refused(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w", libver="latest") as file:
        file.attrs["text"] = "words"
    with pytest.raises(ValueError, match="another version"):
        lengths(tmp_path / "a.h5")
