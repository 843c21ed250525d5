"""A digest behind an HDF5 file, which has no checksums of its own.

HDF5 knows where its content ends and does not look further: with the digest behind that, any
program opens the file, and not a bit of it, slack and structure included, can change unnoticed.
"""

from __future__ import annotations

import hashlib
import os
from typing import BinaryIO

from keras_pendulum.errors import WeightsError

_MARK = b"\nkeras_pendulum sha256 "
_SEAL = len(_MARK) + 64  # bytes


def sealed(image: bytes) -> bytes:
    """A file's bytes with their digest behind them."""
    return image + _MARK + hashlib.sha256(image).hexdigest().encode()


def verify(file: BinaryIO, path: str | os.PathLike[str]) -> None:
    """Raises WeightsError when the bytes of a sealed file are not those that were sealed.

    A file without a seal, as Keras writes them, passes.
    """
    size = file.seek(0, os.SEEK_END) - _SEAL
    file.seek(max(0, size))
    seal = file.read()
    if not seal.startswith(_MARK):
        return
    file.seek(0)
    sha256 = hashlib.sha256()
    while size > 0 and (part := file.read(min(size, 2**20))):
        sha256.update(part)
        size -= len(part)
    if sha256.hexdigest().encode() != seal[len(_MARK) :]:
        raise WeightsError(
            f"{path}: the file is damaged, or was changed by another program (its SHA-256 is not "
            "the one recorded)"
        )
