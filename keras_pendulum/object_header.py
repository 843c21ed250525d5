"""How long the texts of an HDF5 object's attributes say they are, read from the file's own bytes.

HDF5 sets aside as much memory as a text of variable length claims, up to 4 GiB, before it finds out
whether there is so much. So the claims are looked at before HDF5 reads any such text.
HDF5 File Format Specification version 3.0, IV.A "Data Object Headers" and its "Attribute Message".
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import BinaryIO

_CONTINUATION, _ATTRIBUTE = 0x10, 0x0C  # kinds of messages
_VARIABLE_LENGTH = 9  # class of a datatype
_LARGEST = 2**20  # bytes of a header in all; an attribute has 64 KB at most


def text_lengths(file: BinaryIO, address: int) -> Iterator[int]:
    """The bytes that each text of variable length claims, in the attributes of one object.

    Args:
        file: the HDF5 file.
        address: of the object's header.

    Raises ValueError for a header that is damaged, or not of the kind that HDF5 writes by default.
    """
    for kind, message in _messages(file, address):
        if kind == _ATTRIBUTE:
            datatype, data = _attribute(message)
            if datatype[0] & 0x0F == _VARIABLE_LENGTH:
                # Of each text: its length, the heap's address (8 bytes), its number there (4).
                yield from (length for length, _, _ in struct.iter_unpack("<IQI", data))


def _messages(file: BinaryIO, address: int) -> Iterator[tuple[int, bytes]]:
    file.seek(address)
    version, _, _, size = struct.unpack("<BxHII4x", _read(file, 16))
    if version != 1:
        raise ValueError("an object header of another version")
    blocks = [(address + 16, size)]
    left = _LARGEST
    while blocks:
        start, size = blocks.pop()
        left -= size
        if left < 0:
            raise ValueError("an object header without an end")
        file.seek(start)
        block = _read(file, size)
        place = 0
        while place + 8 <= size:
            kind, length = struct.unpack_from("<HH", block, place)
            message = block[place + 8 : place + 8 + length]
            place += 8 + length
            if kind == _CONTINUATION:
                blocks.append(struct.unpack_from("<QQ", message))
            yield kind, message


def _attribute(message: bytes) -> tuple[bytes, bytes]:
    """Datatype and data of an attribute message."""
    version, _, name, datatype, dataspace = struct.unpack_from("<BBHHH", message)
    place = 9 if version == 3 else 8
    # Version 1 fills each part up to a multiple of 8 bytes.
    name, padded, dataspace = (
        -(-part // 8) * 8 if version == 1 else part for part in (name, datatype, dataspace)
    )
    place += name
    return message[place : place + datatype], message[place + padded + dataspace :]


def _read(file: BinaryIO, size: int) -> bytes:
    data = file.read(size)
    if len(data) < size:
        raise ValueError("an object header beyond the end of the file")
    return data
