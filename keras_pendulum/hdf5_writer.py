"""HDF5 files made in memory, by h5py's low-level calls.

A checkpoint is made in the middle of a run, which goes on more slowly meanwhile, and h5py's usual
calls would take longer.
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
_IN_MEMORY.set_fapl_core(2**23, backing_store=False)  # so many bytes are taken at a time
_WITHOUT_TIMES = h5p.create(h5p.DATASET_CREATE)  # the same arrays make the same file
_WITHOUT_TIMES.set_obj_track_times(False)


@contextmanager
def file_in_memory() -> Iterator[h5f.FileID]:
    """A new file that no disk will hold; its bytes come from `image`, inside the `with` block."""
    # A name of its own: HDF5 does not open two files of one name at a time.
    file = h5f.create(uuid4().bytes.hex().encode(), h5f.ACC_TRUNC, fapl=_IN_MEMORY)
    try:
        yield file
    finally:
        file.close()


def image(file: h5f.FileID) -> bytes:
    """The bytes that the file would have on a disk."""
    h5f.flush(file)
    content: bytes = file.get_file_image()
    return content


def add_group(parent: h5f.FileID | h5g.GroupID, name: str) -> h5g.GroupID:
    """A new group in a group or file."""
    return h5g.create(parent, name.encode())


def add_arrays(group: h5g.GroupID, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Writes arrays of numbers into a group, by name."""
    for name, array in arrays.items():
        kind, space = _type_and_shape(array)
        dataset = h5d.create(group, name.encode(), kind, space, _WITHOUT_TIMES)
        dataset.write(h5s.ALL, h5s.ALL, np.ascontiguousarray(array))


def add_attributes(holder: h5f.FileID | h5g.GroupID, values: Mapping[str, ArrayLike]) -> None:
    """Gives a group or file attributes: numbers, bytes, or arrays of them.

    Texts are bytes here, of a fixed length: HDF5's other texts are pointers into a heap that no
    reader can bound.
    """
    for name, value in values.items():
        array = np.asarray(value)
        kind, space = _type_and_shape(array)
        h5a.create(holder, name.encode(), kind, space).write(array)


def _type_and_shape(array: NDArray[Any]) -> tuple[h5t.TypeID, h5s.SpaceID]:
    return _type(array.dtype), h5s.create_simple(array.shape)


@cache
def _type(dtype: np.dtype[Any]) -> h5t.TypeID:
    return h5t.py_create(dtype, logical=True)
