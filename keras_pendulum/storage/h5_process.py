"""The process that reads HDF5 files for `quarantine`, so that a hostile file harms nothing else.

HDF5's C code can crash, loop for ever or allocate gigabytes for a damaged file. This process has
limits on its memory and processor time, and imports h5py and NumPy only. It answers requests, one
JSON object a line on its standard input:

    {"open": PATH}   -> {"attributes": {OBJECT: {NAME: VALUE}}, "arrays": {OBJECT: [DTYPE, SHAPE]}}
    {"read": OBJECT} -> {} and the bytes of the array
    {"close": null}  -> {}

Each answer on its standard output starts with the size of its JSON, 8 bytes. An object is named by
its path in the file; the file itself is "". A refused file is answered by {"error": MESSAGE}.
"""

from __future__ import annotations

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

from keras_pendulum.config.config import LARGEST_FILE
from keras_pendulum.errors import WeightsError
from keras_pendulum.storage import checksum
from keras_pendulum.storage.h5_validation import contents
from keras_pendulum.storage.quarantine import LARGEST_ANSWER, seconds_for

_MEMORY = 48 * 2**20  # bytes beyond the memory after the imports, and twice the size of the file


class _WholeFile(io.FileIO):
    """A file that raises OSError at its end, where h5py would return bytes that are not in it."""

    def readinto(self, buffer: Any) -> int:
        """Fills the buffer."""
        view = memoryview(buffer).cast("B")
        done = 0
        while done < len(view):
            count = super().readinto(view[done:])
            if not count:
                raise OSError("the file ends too early")
            done += count
        return done


class _Reader:
    """Answers the requests; at most one file is open at a time."""

    def __init__(self) -> None:
        self._file: h5py.File | None = None
        self._stream: BinaryIO | None = None

    def answer(self, request: dict[str, Any]) -> tuple[dict[str, Any], Any]:
        """Returns the JSON of the answer, and the array that follows it or None."""
        if "read" in request:
            assert self._file is not None
            return {}, np.ascontiguousarray(self._file[request["read"]][()])
        self._close()
        return (self._open(request["open"]) if "open" in request else {}), None

    def _close(self) -> None:
        for each in (self._file, self._stream):
            if each is not None:
                each.close()
        self._file = self._stream = None

    def _open(self, path: str) -> dict[str, Any]:
        """Opens a file and returns its attributes and the types and shapes of its arrays."""
        self._stream = _open_stream(path)
        size = os.fstat(self._stream.fileno()).st_size
        _limit(size)
        start = self._stream.read(4)
        self._stream.seek(0)
        if start == b"PK\x03\x04":
            config, content = _unpack(self._stream, size)
            self._file = h5py.File(content, "r")
            tree = contents(self._file, size)
            tree["attributes"][""]["model_config"] = config
            return tree
        if start != b"\x89HDF":
            raise WeightsError("not an HDF5 file; expected a weights file (.h5)")
        checksum.verify(self._stream)
        self._file = h5py.File(self._stream, "r")
        return contents(self._file, size)


def _open_stream(path: str) -> BinaryIO:
    """Opens a file that is not empty, not too large, and not being written."""
    file = Path(path)
    if not file.exists():
        raise WeightsError("no such file; expected a weights file (.h5)")
    if not file.is_file():
        raise WeightsError("not a file; expected a weights file (.h5)")
    try:
        stream = _WholeFile(path)
    except OSError as error:
        raise WeightsError(f"cannot be read ({error.strerror})") from error
    size = os.fstat(stream.fileno()).st_size
    if not size:
        raise WeightsError("the file is empty; expected a weights file (.h5)")
    if size > LARGEST_FILE:
        raise WeightsError("larger than 1 GiB, the limit of a weights file")
    if sys.platform != "win32":
        import fcntl

        try:  # HDF5 locks a file that it writes
            fcntl.flock(stream, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise WeightsError(
                "another program has opened the file for writing; close it there, or try "
                "again later"
            ) from error
        except OSError:  # a file system without locks
            pass
    return stream


def _unpack(stream: BinaryIO, size: int) -> tuple[str, BinaryIO]:
    """Returns the model's configuration and its HDF5 file from a `.keras` file, a ZIP archive."""
    with zipfile.ZipFile(stream) as archive:
        for name, limit in {"config.json": LARGEST_ANSWER, "model.weights.h5": size}.items():
            if name not in archive.namelist():
                raise WeightsError(f"not a file of Keras, it has no {name}")
            if archive.getinfo(name).file_size > min(size, limit):
                raise WeightsError(f"its {name} is too large")
        content = io.BytesIO(archive.read("model.weights.h5"))
        return archive.read("config.json").decode(), content


def _limit(file_size: int) -> None:
    """Limits memory and processor time until the next file, where the system can.

    Elsewhere, the clock of the parent ends this process.
    """
    if sys.platform != "win32":
        import resource

        usage = resource.getrusage(resource.RUSAGE_SELF)
        limits = {
            resource.RLIMIT_CPU: math.ceil(
                usage.ru_utime + usage.ru_stime + seconds_for(file_size)
            ),
            resource.RLIMIT_CORE: 0,
        }
        if _SIZE_AT_START:
            limits[resource.RLIMIT_AS] = _SIZE_AT_START + _MEMORY + 2 * file_size
        for kind, limit in limits.items():
            _, hard = resource.getrlimit(kind)
            soft = limit if hard == resource.RLIM_INFINITY else min(limit, hard)
            resource.setrlimit(kind, (soft, hard))


def _address_space() -> int:
    """Returns the bytes of this process's address space, 0 where the system does not say."""
    if sys.platform != "linux":
        return 0
    pages = int(Path("/proc/self/statm").read_bytes().split()[0])
    return pages * os.sysconf("SC_PAGE_SIZE")


_SIZE_AT_START = _address_space()


def main() -> None:
    """Answers requests until the parent closes its end."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C in the terminal is for the parent
    # Nothing else may print between the answers.
    output = os.fdopen(os.dup(1), "wb")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    reader = _Reader()

    def send(content: dict[str, Any], array: Any = None) -> None:
        text = json.dumps(content).encode()
        output.write(len(text).to_bytes(8, "little") + text)
        if array is not None:
            output.write(array.reshape(-1).view(np.uint8).data)
        output.flush()

    send({})  # ready
    for line in sys.stdin.buffer:
        request = json.loads(line)
        array = None
        try:
            content, array = reader.answer(request)
            if len(json.dumps(content)) > LARGEST_ANSWER:
                raise WeightsError(f"{request['open']}: holds too many names and attributes")
        except WeightsError as error:
            content = {"error": str(error)}
        except Exception as error:  # damage causes any error of h5py, and of this code
            reason = " ".join(str(error).split()) or type(error).__name__
            content = {"error": f"cannot be read, the file is damaged ({reason})"}
        send(content, array)


if __name__ == "__main__":
    main()
