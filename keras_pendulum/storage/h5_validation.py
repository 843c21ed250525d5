"""Checks that an HDF5 file is a small tree of groups and plain arrays.

HDF5 allows much more: links to other files, groups that contain themselves, arrays larger than
their data. All of that is rejected before any array is read, so that a hostile file costs neither
time nor memory.
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
from keras_pendulum.storage.object_header import string_lengths

_MOST_ENTRIES = 1000  # groups and arrays; a checkpoint has about 60
_DEEPEST = 10  # nested groups; Keras 3 nests 4
_MOST_ATTRIBUTES = 64  # of one group or array
_LARGEST_ATTRIBUTE = 2**16  # bytes; HDF5's own limit for attributes in an object header
# The size of a variable-length string is unknown until it is read from its heap.
_LARGEST_FILE_WITH_STRINGS = 2**26  # bytes
_HEAP = b"GCOL\x01"  # start of a heap; HDF5 ignores the three bytes behind


def check_heaps(file: BinaryIO, path: str | os.PathLike[str]) -> None:
    """Raises WeightsError for a heap of strings that HDF5 would read in an endless loop.

    HDF5 File Format Specification, "Global Heap": a header of 16 bytes with the heap's size, then
    objects with a header of 16 bytes each. The last object, number 0, is the free space. HDF5
    finds each object by the size of the previous one, and does not reject the size 0.
    """
    if file.seek(0, os.SEEK_END) == 0:
        return
    with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
        start = content.find(_HEAP)
        while start >= 0:
            end = start + int.from_bytes(content[start + 8 : start + 16], "little")
            offset = start + 16
            while offset + 16 <= min(end, len(content)):
                number = int.from_bytes(content[offset : offset + 2], "little")
                size = int.from_bytes(content[offset + 8 : offset + 16], "little")
                # Only the size of the free space includes its header.
                step = size if number == 0 else 16 + -(-size // 8) * 8
                if step < 16 or offset + step > end:
                    raise WeightsError(f"{path}: the file is damaged, its strings cannot be read")
                offset += step
            start = content.find(_HEAP, start + 8)


def check(file: h5py.File, path: str | os.PathLike[str]) -> None:
    """Raises WeightsError for anything but groups, plain arrays and small attributes."""
    size = Path(path).stat().st_size
    declared = 0
    for count, entry in enumerate(_entries(file, path)):
        if count > _MOST_ENTRIES:
            raise WeightsError(f"{path}: holds more than {_MOST_ENTRIES} groups and arrays")
        _check_attributes(entry, size, path)
        _check_strings(entry, path)
        if isinstance(entry, h5py.Dataset):
            _check_array(entry, path)
            declared += _bytes_in(entry)
            if declared > size:
                raise WeightsError(
                    f"{path}: its arrays up to {entry.name} declare {declared} bytes; the file has "
                    f"{size}"
                )
        elif not isinstance(entry, h5py.Group):
            raise WeightsError(f"{path}: {entry.name} is neither a group nor an array")


def _entries(group: h5py.Group, path: str | os.PathLike[str], depth: int = 0) -> Iterator[Any]:
    """Yields the group and all entries below it; an entry with several names several times."""
    yield group
    if depth > _DEEPEST:  # also where a group contains itself
        raise WeightsError(f"{path}: {group.name} is nested in more than {_DEEPEST} groups")
    if len(group) > _MOST_ENTRIES:
        raise WeightsError(f"{path}: {group.name} holds {len(group)} entries")
    for name in group:
        if not isinstance(group.get(name, getlink=True), h5py.HardLink):
            raise WeightsError(f"{path}: {group.name} holds a link, {name}; expected arrays")
        entry = group[name]
        if isinstance(entry, h5py.Group):
            yield from _entries(entry, path, depth + 1)
        else:
            yield entry


def _check_array(dataset: h5py.Dataset, path: str | os.PathLike[str]) -> None:
    is_plain = (
        dataset.dtype.kind in "fiub"
        and dataset.chunks is None
        and not dataset.external
        and not dataset.is_virtual
        and dataset.id.get_storage_size() == _bytes_in(dataset)
    )
    if not is_plain:
        raise WeightsError(
            f"{path}: {dataset.name} ({dataset.dtype}, {dataset.shape}) is not a plain array of "
            "numbers with all its data in this file"
        )


def _bytes_in(dataset: h5py.Dataset) -> int:
    # In Python's integers, because h5py's own product can overflow.
    return math.prod(dataset.shape) * dataset.dtype.itemsize


def _check_attributes(entry: Any, size: int, path: str | os.PathLike[str]) -> None:
    if len(entry.attrs) > _MOST_ATTRIBUTES:
        raise WeightsError(f"{path}: {entry.name} has {len(entry.attrs)} attributes")
    for name in entry.attrs:
        attribute = entry.attrs.get_id(name)
        is_string = _is_variable_length_string(attribute)
        if math.prod(attribute.shape) * attribute.dtype.itemsize > _LARGEST_ATTRIBUTE:
            raise WeightsError(f"{path}: {entry.name} has a huge attribute, {name}")
        if is_string and size > _LARGEST_FILE_WITH_STRINGS:
            raise WeightsError(
                f"{path}: {entry.name} has a string of variable length, {name}; in a file of more "
                f"than {_LARGEST_FILE_WITH_STRINGS // 2**20} MiB, strings must have a fixed length"
            )
        if not is_string and attribute.dtype.kind not in "fiubS":
            raise WeightsError(f"{path}: {entry.name} has an attribute {name} of no plain type")


def _check_strings(entry: Any, path: str | os.PathLike[str]) -> None:
    """Raises WeightsError when the entry's variable-length strings declare a large size."""
    attributes = map(entry.attrs.get_id, entry.attrs)
    count = sum(math.prod(each.shape) for each in attributes if _is_variable_length_string(each))
    if count:
        try:
            with open(path, "rb") as file:
                lengths = list(string_lengths(file, h5py.h5o.get_info(entry.id).addr))
        except (ValueError, struct.error):
            lengths = []
        if len(lengths) != count or sum(lengths) > _LARGEST_ATTRIBUTE:
            raise WeightsError(f"{path}: {entry.name} has damaged or huge strings as attributes")


def _is_variable_length_string(attribute: Any) -> bool:
    string = h5py.check_string_dtype(attribute.dtype)
    return string is not None and string.length is None
