"""The lengths of variable-length strings in an object's attributes, read from the file's bytes.

HDF5 allocates the length that such a string declares, up to 4 GiB, before it checks that so many
bytes exist. This module reads the declared lengths before HDF5 reads the strings.
HDF5 File Format Specification version 3.0, IV.A "Data Object Headers" and its "Attribute Message".
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import BinaryIO

_CONTINUATION, _ATTRIBUTE = 0x10, 0x0C  # types of messages
_VARIABLE_LENGTH = 9  # class of a datatype
_LARGEST_HEADER = 2**20  # bytes; one attribute has at most 64 KB


def string_lengths(file: BinaryIO, address: int) -> Iterator[int]:
    """Yields the declared length in bytes of each variable-length string of an object's attributes.

    Args:
        file: the HDF5 file.
        address: address of the object's header.

    Raises ValueError for a damaged header, and for one of another version than HDF5's default.
    """
    for message_type, message in _messages(file, address):
        if message_type == _ATTRIBUTE:
            datatype, data = _attribute(message)
            if datatype[0] & 0x0F == _VARIABLE_LENGTH:
                # Of each string: its length, the address of its heap (8 bytes), its index (4).
                yield from (length for length, _, _ in struct.iter_unpack("<IQI", data))


def _messages(file: BinaryIO, address: int) -> Iterator[tuple[int, bytes]]:
    """Yields type and content of each message of an object header."""
    file.seek(address)
    version, _, _, size = struct.unpack("<BxHII4x", _read(file, 16))
    if version != 1:
        raise ValueError("an object header of another version")
    blocks = [(address + 16, size)]
    remaining = _LARGEST_HEADER
    while blocks:
        start, size = blocks.pop()
        remaining -= size
        if remaining < 0:
            raise ValueError("an object header of more than 1 MiB")
        file.seek(start)
        block = _read(file, size)
        offset = 0
        while offset + 8 <= size:
            message_type, length = struct.unpack_from("<HH", block, offset)
            message = block[offset + 8 : offset + 8 + length]
            offset += 8 + length
            if message_type == _CONTINUATION:
                blocks.append(struct.unpack_from("<QQ", message))
            yield message_type, message


def _attribute(message: bytes) -> tuple[bytes, bytes]:
    """Returns the datatype and the data of an attribute message."""
    version, _, name, datatype, dataspace = struct.unpack_from("<BBHHH", message)
    offset = 9 if version == 3 else 8
    # Version 1 pads each part to a multiple of 8 bytes.
    name, padded_datatype, dataspace = (
        -(-part // 8) * 8 if version == 1 else part for part in (name, datatype, dataspace)
    )
    offset += name
    return message[offset : offset + datatype], message[offset + padded_datatype + dataspace :]


def _read(file: BinaryIO, size: int) -> bytes:
    data = file.read(size)
    if len(data) < size:
        raise ValueError("an object header beyond the end of the file")
    return data
