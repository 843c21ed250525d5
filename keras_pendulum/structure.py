"""What an HDF5 file may consist of here: a small tree of plain arrays.

HDF5 can do much more: point into other files, at itself, or at less than it declares. All of that
is refused before a single array is read, so that a stranger's file costs neither time nor memory.
"""

from __future__ import annotations

import math
import mmap
import os
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

import h5py

from keras_pendulum.errors import WeightsError
from keras_pendulum.object_header import text_lengths

_MOST_ENTRIES = 1000  # groups and arrays; a checkpoint has about 60
_DEEPEST = 10  # groups inside groups; Keras 3 goes down to 4
_MOST_ATTRIBUTES = 64  # of one group or array
_LARGEST_ATTRIBUTE = 2**16  # bytes, HDF5's own limit where attributes lie in an object's header
# A text of variable length lies in a heap that cannot be measured without reading it.
_LARGEST_FILE_WITH_TEXTS = 2**26  # bytes
_HEAP = b"GCOL\x01"  # what such a heap starts with; HDF5 does not look at the three bytes behind


def check_heaps(file: BinaryIO, path: str | os.PathLike[str]) -> None:
    """Raises WeightsError for a heap of texts that HDF5 would read without an end.

    HDF5 File Format Specification, "Global Heap": a head of 16 bytes with the heap's size, then
    objects with a head of 16 bytes each, the last of which, number 0, is what is free. HDF5 goes
    from each to the next by the sizes they state, even where that is nothing.
    """
    if file.seek(0, os.SEEK_END) == 0:
        return
    with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
        start = content.find(_HEAP)
        while start >= 0:
            end = start + int.from_bytes(content[start + 8 : start + 16], "little")
            place = start + 16
            while place + 16 <= min(end, len(content)):
                number = int.from_bytes(content[place : place + 2], "little")
                size = int.from_bytes(content[place + 8 : place + 16], "little")
                # Only the free space counts its own head.
                step = size if number == 0 else 16 + -(-size // 8) * 8
                if step < 16 or place + step > end:
                    raise WeightsError(f"{path}: the file is damaged, its texts cannot be read")
                place += step
            start = content.find(_HEAP, start + 8)


def check(file: h5py.File, path: str | os.PathLike[str]) -> None:
    """Raises WeightsError for anything but groups, plain arrays and small attributes."""
    size = Path(path).stat().st_size
    stored = 0
    for count, entry in enumerate(_entries(file, path)):
        if count > _MOST_ENTRIES:
            raise WeightsError(f"{path}: holds more than {_MOST_ENTRIES} groups and arrays")
        _check_attributes(entry, size, path)
        _check_texts(entry, path)
        if isinstance(entry, h5py.Dataset):
            _check_array(entry, path)
            stored += _bytes_in(entry)
            if stored > size:
                raise WeightsError(
                    f"{path}: its arrays up to {entry.name} declare {stored} bytes; the file has "
                    f"{size}"
                )
        elif not isinstance(entry, h5py.Group):
            raise WeightsError(f"{path}: {entry.name} is neither a group nor an array")


def _entries(group: h5py.Group, path: str | os.PathLike[str], depth: int = 0) -> Iterator[Any]:
    """The group and all below it, each as often as something leads to it."""
    yield group
    if depth > _DEEPEST:  # also where a group contains itself
        raise WeightsError(f"{path}: {group.name} lies more than {_DEEPEST} groups deep")
    if len(group) > _MOST_ENTRIES:
        raise WeightsError(f"{path}: {group.name} holds {len(group)} entries")
    for name in group:
        if not isinstance(group.get(name, getlink=True), h5py.HardLink):
            raise WeightsError(f"{path}: {group.name} has a link, {name}, in place of an array")
        entry = group[name]
        if isinstance(entry, h5py.Group):
            yield from _entries(entry, path, depth + 1)
        else:
            yield entry


def _check_array(dataset: h5py.Dataset, path: str | os.PathLike[str]) -> None:
    plain = (
        dataset.dtype.kind in "fiub"
        and dataset.chunks is None
        and not dataset.external
        and not dataset.is_virtual
        and dataset.id.get_storage_size() == _bytes_in(dataset)
    )
    if not plain:
        raise WeightsError(
            f"{path}: {dataset.name} ({dataset.dtype}, {dataset.shape}) is not a plain array of "
            "numbers stored whole in this file"
        )


def _bytes_in(dataset: h5py.Dataset) -> int:
    # In Python's integers, because h5py's own product can overflow.
    return math.prod(dataset.shape) * dataset.dtype.itemsize


def _check_attributes(entry: Any, size: int, path: str | os.PathLike[str]) -> None:
    if len(entry.attrs) > _MOST_ATTRIBUTES:
        raise WeightsError(f"{path}: {entry.name} has {len(entry.attrs)} attributes")
    for name in entry.attrs:
        attribute = entry.attrs.get_id(name)
        variable = _is_text(attribute)
        if math.prod(attribute.shape) * attribute.dtype.itemsize > _LARGEST_ATTRIBUTE:
            raise WeightsError(f"{path}: {entry.name} has a huge attribute, {name}")
        if variable and size > _LARGEST_FILE_WITH_TEXTS:
            raise WeightsError(f"{path}: {entry.name} has a text of no fixed length, {name}")
        if not variable and attribute.dtype.kind not in "fiubS":
            raise WeightsError(f"{path}: {entry.name} has an attribute {name} of no plain type")


def _check_texts(entry: Any, path: str | os.PathLike[str]) -> None:
    """Raises WeightsError when the entry's texts of variable length claim to be large."""
    attributes = map(entry.attrs.get_id, entry.attrs)
    texts = sum(math.prod(each.shape) for each in attributes if _is_text(each))
    if texts:
        try:
            with open(path, "rb") as file:
                lengths = list(text_lengths(file, h5py.h5o.get_info(entry.id).addr))
        except (ValueError, struct.error):
            lengths = []
        if len(lengths) != texts or sum(lengths) > _LARGEST_ATTRIBUTE:
            raise WeightsError(f"{path}: the texts beside {entry.name} are damaged or huge")


def _is_text(attribute: Any) -> bool:
    """Whether it holds texts of variable length."""
    text = h5py.check_string_dtype(attribute.dtype)
    return text is not None and text.length is None
