"""HDF5 files built in memory with h5py's low-level calls.

A thread writes the checkpoints while the run continues. h5py's usual calls take longer, and would
slow down the run.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from typing import Any
from uuid import uuid4

import numpy as np
from h5py import h5a, h5d, h5f, h5g, h5p, h5s, h5t
from numpy.typing import ArrayLike, NDArray

_IN_MEMORY = h5p.create(h5p.FILE_ACCESS)
_IN_MEMORY.set_fapl_core(2**23, backing_store=False)  # grows in blocks of 8 MiB
_WITHOUT_TIMES = h5p.create(h5p.DATASET_CREATE)  # the same arrays make the same file
_WITHOUT_TIMES.set_obj_track_times(False)


@contextmanager
def file_in_memory() -> Iterator[h5f.FileID]:
    """Yields a new file in memory; `file_bytes` returns its content inside the `with` block."""
    # A unique name, because HDF5 does not open two files of the same name at a time.
    file = h5f.create(uuid4().bytes.hex().encode(), h5f.ACC_TRUNC, fapl=_IN_MEMORY)
    try:
        yield file
    finally:
        file.close()


def file_bytes(file: h5f.FileID) -> bytes:
    """Returns the bytes of the file as they would be on a disk."""
    h5f.flush(file)
    content: bytes = file.get_file_image()
    return content


def add_group(parent: h5f.FileID | h5g.GroupID, name: str) -> h5g.GroupID:
    """Adds a group to a file or group and returns it."""
    return h5g.create(parent, name.encode())


def add_arrays(group: h5g.GroupID, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Adds arrays of numbers to a group, by name."""
    for name, array in arrays.items():
        datatype, shape = _type_and_shape(array)
        dataset = h5d.create(group, name.encode(), datatype, shape, _WITHOUT_TIMES)
        dataset.write(h5s.ALL, h5s.ALL, np.ascontiguousarray(array))


def add_attributes(parent: h5f.FileID | h5g.GroupID, values: Mapping[str, ArrayLike]) -> None:
    """Adds attributes to a file or group: numbers, bytes, or arrays of them.

    Strings are bytes of fixed length. HDF5 stores its variable-length strings in a heap, and no
    reader can limit the size of a heap.
    """
    for name, value in values.items():
        array = np.asarray(value)
        datatype, shape = _type_and_shape(array)
        h5a.create(parent, name.encode(), datatype, shape).write(array)


def _type_and_shape(array: NDArray[Any]) -> tuple[h5t.TypeID, h5s.SpaceID]:
    return _type(array.dtype), h5s.create_simple(array.shape)


@cache
def _type(dtype: np.dtype[Any]) -> h5t.TypeID:
    return h5t.py_create(dtype, logical=True)
