"""A digest behind an HDF5 file, which has no checksums of its own.

HDF5 knows where its content ends and does not look further: with the digest behind that, any
program opens the file, and not a bit of it, slack and structure included, can change unnoticed.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

from keras_pendulum.atomic_file import write_atomically
from keras_pendulum.errors import WeightsError

_MARK = b"\nkeras_pendulum sha256 "
_SEAL = len(_MARK) + 64  # bytes


def write_sealed(
    path: str | os.PathLike[str],
    content: bytes,
    check: Callable[[Path], object] = lambda file: None,
) -> None:
    """As `write_atomically`, the content with its digest behind it."""
    digest = hashlib.sha256(content).hexdigest()
    write_atomically(path, content, _MARK + digest.encode(), check=check)


def verify(file: BinaryIO, path: str | os.PathLike[str]) -> None:
    """Raises WeightsError when the bytes of a sealed file are not those that were sealed.

    A file without anything behind its content, as Keras writes them, passes.
    """
    head = file.read(64)
    size = file.seek(0, os.SEEK_END)
    end = _end_of_content(head)
    if end is None or size <= end:
        return
    content = max(0, size - _SEAL)
    file.seek(content)
    seal = file.read()
    file.seek(0)
    sha256 = hashlib.sha256()
    while content > 0 and (part := file.read(min(content, 2**20))):
        sha256.update(part)
        content -= len(part)
    if seal != _MARK + sha256.hexdigest().encode():
        raise WeightsError(
            f"{path}: the file is damaged, or was changed by another program (its SHA-256 is not "
            "the one recorded)"
        )


def _end_of_content(head: bytes) -> int | None:
    """Where HDF5 says in a file's first 64 bytes that its content ends; None if it says nothing.

    HDF5 File Format Specification, "Superblock": the versions keep it in different places.
    """
    place = {0: 40, 1: 44, 2: 28, 3: 28}.get(head[8]) if len(head) == 64 else None
    if place is None or not head.startswith(b"\x89HDF"):
        return None
    return int.from_bytes(head[place : place + 8], "little")
