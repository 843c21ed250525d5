"""A SHA-256 at the end of an HDF5 file, because HDF5 has no checksum of its own.

HDF5 records where its content ends and ignores the bytes behind it. So any program opens a file
with a checksum, and every change of its content is detected.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

from keras_pendulum.errors import WeightsError
from keras_pendulum.storage.atomic_write import write_atomically

_LABEL = b"\nkeras_pendulum sha256 "
_CHECKSUM_SIZE = len(_LABEL) + 64  # bytes


def write_with_checksum(
    path: str | os.PathLike[str],
    content: bytes,
    check: Callable[[Path], object] = lambda file: None,
) -> None:
    """Writes the content and its checksum. See `write_atomically`."""
    digest = hashlib.sha256(content).hexdigest()
    write_atomically(path, content, _LABEL + digest.encode(), check=check)


def verify(file: BinaryIO) -> None:
    """Raises WeightsError when a file does not match its checksum.

    Accepts a file that ends with its HDF5 content: Keras writes no checksum.
    """
    head = file.read(64)
    size = file.seek(0, os.SEEK_END)
    end = _end_of_content(head)
    if end is None or size <= end:
        return
    content_size = max(0, size - _CHECKSUM_SIZE)
    file.seek(content_size)
    found = file.read()
    file.seek(0)
    sha256 = hashlib.sha256()
    while content_size > 0 and (part := file.read(min(content_size, 2**20))):
        sha256.update(part)
        content_size -= len(part)
    if found != _LABEL + sha256.hexdigest().encode():
        raise WeightsError(
            "the file is damaged, or another program changed it (its SHA-256 differs from the "
            "recorded one)"
        )


def _end_of_content(head: bytes) -> int | None:
    """Returns the size of the HDF5 content from the first 64 bytes of a file, None if unknown.

    HDF5 File Format Specification, "Superblock": the offset depends on the version.
    """
    offset = {0: 40, 1: 44, 2: 28, 3: 28}.get(head[8]) if len(head) == 64 else None
    if offset is None or not head.startswith(b"\x89HDF"):
        return None
    return int.from_bytes(head[offset : offset + 8], "little")
