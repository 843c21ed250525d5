"""Lists what an HDF5 file holds, and refuses what a weights file does not need.

HDF5 allows links to other files, groups that contain themselves, and arrays whose numbers are in
other files or nowhere. The process of `h5_process` calls this module, because HDF5 may also crash.
"""

from __future__ import annotations

import math
from typing import Any

import h5py
import numpy as np

from keras_pendulum.errors import WeightsError

_MOST_ENTRIES = 1000  # groups and arrays; a checkpoint has about 60
_LARGEST_ATTRIBUTE = 2**16  # bytes


def contents(file: h5py.File, size: int) -> dict[str, dict[str, Any]]:
    """Returns all attributes, and types and shapes of all arrays.

    Raises WeightsError for links, for objects with two names, and for arrays whose data is not in
    the file itself: they could be other files' numbers, zeros, or larger than the file.
    """
    attributes: dict[str, dict[str, Any]] = {}
    arrays: dict[str, Any] = {}
    addresses = set()
    entries: list[tuple[str, Any]] = [("", file)]
    declared = 0
    while entries:
        name, entry = entries.pop()
        address = h5py.h5o.get_info(entry.id).addr
        if address in addresses:
            raise WeightsError(f"{name} is another name of a part of the file")
        addresses.add(address)
        if len(addresses) > _MOST_ENTRIES:
            raise WeightsError(f"holds more than {_MOST_ENTRIES} groups and arrays")
        attributes[name] = {key: _attribute(entry, key) for key in entry.attrs}
        if isinstance(entry, h5py.Dataset):
            bytes_in_array = math.prod(entry.shape or ()) * entry.dtype.itemsize
            if not _is_plain(entry, bytes_in_array):
                raise WeightsError(
                    f"{name} ({entry.dtype}, {entry.shape}) is not a plain array of "
                    "numbers with all its data in this file"
                )
            declared += bytes_in_array
            if declared > size:
                raise WeightsError(
                    f"its arrays up to {name} declare {declared} bytes; the file has {size}"
                )
            arrays[name] = [entry.dtype.str, entry.shape]
        elif not isinstance(entry, h5py.Group):
            raise WeightsError(f"{name} is neither a group nor an array")
        else:
            for key in entry:
                if not isinstance(entry.get(key, getlink=True), h5py.HardLink):
                    raise WeightsError(f"{name or '/'} holds a link, {key}")
                entries.append((f"{name}/{key}".lstrip("/"), entry[key]))
    return {"attributes": attributes, "arrays": arrays}


def _is_plain(dataset: h5py.Dataset, bytes_in_array: int) -> bool:
    return (
        dataset.dtype.kind in "fiub"
        and dataset.chunks is None
        and not dataset.external
        and not dataset.is_virtual
        and dataset.id.get_storage_size() == bytes_in_array
    )


def _attribute(entry: Any, name: str) -> Any:
    """Returns an attribute as JSON can hold it; None where it is no text and no small array."""
    attribute = entry.attrs.get_id(name)
    if math.prod(attribute.shape or ()) * attribute.dtype.itemsize > _LARGEST_ATTRIBUTE:
        return None
    value = entry.attrs[name]
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    try:
        return _as_text(value)
    except (TypeError, ValueError):  # another type, or bytes that are not UTF-8
        return None


def _as_text(value: Any) -> Any:
    if isinstance(value, list):
        return [_as_text(each) for each in value]
    if isinstance(value, bytes):
        return value.decode()
    if isinstance(value, str):
        value.encode()  # h5py keeps bytes that are not UTF-8 as surrogates
    elif not isinstance(value, int | float):
        raise TypeError(value)
    return value
