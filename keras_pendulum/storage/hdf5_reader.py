"""The process that reads one HDF5 file for `quarantine`, so that a hostile file harms nothing else.

    python -m keras_pendulum.storage.hdf5_reader SECONDS < FILE > OUTPUT

HDF5's C code can crash, loop for ever or allocate gigabytes for a damaged file. This process limits
its processor time, memory and output, and imports h5py and NumPy only. It writes one line of JSON,
then the bytes of the arrays in the order of the JSON:

    {"attributes": {OBJECT: {NAME: VALUE}}, "arrays": {OBJECT: [DTYPE, SHAPE]}}

An object is named by its path in the file; the file itself is "". For a refused file, the output is
{"error": MESSAGE} alone.
"""

from __future__ import annotations

import contextlib
import io
import json
import math
import os
import signal
import sys
import zipfile
from pathlib import Path
from typing import Any, BinaryIO

import h5py
import numpy as np

from keras_pendulum.errors import WeightsError
from keras_pendulum.limits import LARGEST_DESCRIPTION
from keras_pendulum.storage import checksum

_MOST_ENTRIES = 1000  # groups and arrays; a checkpoint has about 60
_LARGEST_ATTRIBUTE = 2**16  # bytes
_MEMORY = 48 * 2**20  # bytes beyond the memory after the imports, and twice the size of the file


def copy_content(file: BinaryIO, size: int, output: BinaryIO) -> None:
    """Writes the description and the arrays of an HDF5 file, or of the one in a `.keras` file.

    Raises WeightsError for a file of another kind, a wrong checksum, and what `contents` refuses.
    """
    config = None
    start = file.read(4)
    file.seek(0)
    if start == b"PK\x03\x04":
        config, content = _unpack(file, size)
    elif start == b"\x89HDF":
        content = file.read()  # once: a change of the file is not read after the checks
        checksum.verify(content)
    else:
        raise WeightsError("not an HDF5 file; expected a weights file (.h5)")
    with h5py.File(io.BytesIO(content), "r") as h5:
        description = contents(h5, size)
        if config is not None:
            description["attributes"][""]["model_config"] = config
        line = json.dumps(description).encode()
        if len(line) >= LARGEST_DESCRIPTION:
            raise WeightsError("holds too many names and attributes")
        output.write(line + b"\n")
        for name in description["arrays"]:
            array = np.ascontiguousarray(h5[name][()])
            output.write(array.reshape(-1).view(np.uint8).data)


def _unpack(file: BinaryIO, size: int) -> tuple[str, bytes]:
    """Returns the model's configuration and its HDF5 file from a `.keras` file, a ZIP archive."""
    with zipfile.ZipFile(file) as archive:
        for name in ("config.json", "model.weights.h5"):
            if name not in archive.namelist():
                raise WeightsError(f"not a file of Keras, it has no {name}")
            if archive.getinfo(name).file_size > size:
                raise WeightsError(f"its {name} is too large")
        return archive.read("config.json").decode(), archive.read("model.weights.h5")


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
        if isinstance(entry, h5py.Group):
            for key in entry:
                if not isinstance(entry.get(key, getlink=True), h5py.HardLink):
                    raise WeightsError(f"{name or '/'} holds a link, {key}")
                entries.append((f"{name}/{key}".lstrip("/"), entry[key]))
        elif isinstance(entry, h5py.Dataset):
            declared += _bytes_in(entry, name)
            if declared > size:
                raise WeightsError(
                    f"its arrays up to {name} declare {declared} bytes; the file has {size}"
                )
            arrays[name] = [entry.dtype.str, entry.shape]
        else:
            raise WeightsError(f"{name} is neither a group nor an array")
    return {"attributes": attributes, "arrays": arrays}


def _bytes_in(array: h5py.Dataset, name: str) -> int:
    """Returns the size of an array of numbers that are all stored in the file, one by one."""
    size = math.prod(array.shape or ()) * array.dtype.itemsize
    if (
        array.dtype.kind not in "fiub"
        or array.chunks is not None
        or array.external
        or array.is_virtual
        or array.id.get_storage_size() != size
    ):
        raise WeightsError(
            f"{name} ({array.dtype}, {array.shape}) is not a plain array of numbers with all its "
            "data in this file"
        )
    return size


def _attribute(entry: Any, name: str) -> Any:
    """Returns an attribute as JSON can hold it; None where it is no text and no small array."""
    attribute = entry.attrs.get_id(name)
    if math.prod(attribute.shape or ()) * attribute.dtype.itemsize > _LARGEST_ATTRIBUTE:
        return None
    value = entry.attrs[name]
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    try:
        text = json.dumps(value, default=bytes.decode, ensure_ascii=False)
        return json.loads(text.encode())
    except (TypeError, ValueError):  # another type, or bytes that are not UTF-8
        return None


def _limit(file_size: int, seconds: float) -> None:
    """Limits processor time, memory and output, where the system can.

    Elsewhere, the clock of the parent ends this process.
    """
    if sys.platform != "win32":
        import resource

        signal.setitimer(signal.ITIMER_PROF, seconds)  # SIGPROF ends the process
        limits = {resource.RLIMIT_CORE: 0, resource.RLIMIT_FSIZE: file_size + LARGEST_DESCRIPTION}
        if sys.platform == "linux":
            pages = int(Path("/proc/self/statm").read_bytes().split()[0])
            memory = pages * os.sysconf("SC_PAGE_SIZE") + _MEMORY + 2 * file_size
            limits[resource.RLIMIT_AS] = memory
        for kind, limit in limits.items():
            with contextlib.suppress(ValueError):  # the user has set a lower one
                resource.setrlimit(kind, (limit, limit))


def main() -> None:
    """Copies the content of the file at standard input to standard output."""
    file, output = open(0, "rb", buffering=0), sys.stdout.buffer  # noqa: SIM115
    size = os.fstat(0).st_size
    _limit(size, float(sys.argv[1]))
    try:
        copy_content(file, size, output)
    except Exception as error:  # damage causes any error of h5py, and of this code
        message = str(error) or type(error).__name__
        if not isinstance(error, WeightsError):
            message = f"cannot be read, the file is damaged ({message})"
        output.seek(0)
        output.truncate()
        output.write(json.dumps({"error": message}).encode())
    output.flush()


if __name__ == "__main__":
    main()
