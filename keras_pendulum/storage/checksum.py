"""A SHA-256 at the end of an HDF5 file, because HDF5 has no checksum of its own.

HDF5 records where its content ends and ignores the bytes behind it. So any program opens a file
with a checksum, and every change of its content is detected.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from pathlib import Path

from keras_pendulum.errors import WeightsError
from keras_pendulum.storage.atomic_write import write_atomically

_LABEL = b"\nkeras_pendulum sha256 "
_CHECKSUM_SIZE = len(_LABEL) + 64  # bytes
# Where a file says that its HDF5 content ends, by the version of its superblock (HDF5 File Format
# Specification, "Superblock").
_PLACE_OF_THE_END = {0: 40, 1: 44, 2: 28, 3: 28}


def write_with_checksum(
    path: str | os.PathLike[str],
    content: bytes,
    check: Callable[[Path], object] = lambda file: None,
) -> None:
    """Writes the content and its checksum. See `write_atomically`."""
    digest = hashlib.sha256(content).hexdigest()
    write_atomically(path, content, _LABEL + digest.encode(), check=check)


def verify(content: bytes) -> None:
    """Raises WeightsError when the content of an HDF5 file does not match its checksum.

    Accepts a file that ends with its HDF5 content: Keras writes no checksum.
    """
    if len(content) < 64 or content[8] not in _PLACE_OF_THE_END:  # HDF5 itself refuses it
        return
    place = _PLACE_OF_THE_END[content[8]]
    end = int.from_bytes(content[place : place + 8], "little")
    if len(content) <= end:
        return
    checked = memoryview(content)[:-_CHECKSUM_SIZE]
    if content[len(checked) :] != _LABEL + hashlib.sha256(checked).hexdigest().encode():
        raise WeightsError(
            "the file is damaged, or another program changed it (its SHA-256 differs from the "
            "recorded one)"
        )
