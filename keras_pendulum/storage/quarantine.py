"""Reads HDF5 files through another process (`hdf5_reader`), so that a hostile file harms only that.

Each file gets a process of its own, which ends when it has read the file. Its output is a temporary
file without a name, not a pipe: `subprocess.run` then does all the waiting and killing, and an
array takes memory only when it is used.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import re
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.errors import UserError, WeightsError
from keras_pendulum.limits import LARGEST_DESCRIPTION, LARGEST_FILE

SECONDS = 8.0  # of processor time for a small file
# The clock ends a process that waits, and any process where the system does not limit its processor
# time. It is generous, because other programs may slow the process down.
_SECONDS_BY_THE_CLOCK = 120.0  # beyond the processor time
_READER = ("-P", "-m", "keras_pendulum.storage.hdf5_reader")
# Which error a wrong value causes depends on the code that uses it.
_DAMAGE = (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError)
_NUMBERS = re.compile(r"[<>|][fiub][1248]")  # NumPy's names of the types of numbers


class H5File:
    """The content of an HDF5 file: attributes and arrays, by the path of their object in it.

    Attributes are numbers, strings and lists of them; None stands for anything else.

    Args:
        path: the file, for messages.
        output: of `hdf5_reader`.
        size: of the file in bytes.

    Raises WeightsError when the reader refused the file, and ValueError for a wrong output.
    """

    def __init__(self, path: str, output: IO[bytes], size: int) -> None:
        self.path = path
        self._output = output
        output.seek(0)
        description = json.loads(output.readline(LARGEST_DESCRIPTION + 1))
        if "error" in description:
            raise WeightsError(f"{path}: {description['error']}")
        self.attributes: dict[str, dict[str, Any]] = description["attributes"]
        self.shapes: dict[str, tuple[int, ...]] = {}  # of all arrays
        self._places: dict[str, tuple[int, np.dtype[Any]]] = {}
        start = place = output.tell()
        for name, (dtype, shape) in description["arrays"].items():
            if not _NUMBERS.fullmatch(dtype) or min(shape, default=0) < 0:
                raise ValueError(f"{name} has the type {dtype} and the shape {shape}")
            self.shapes[name] = tuple(map(int, shape))
            self._places[name] = place, np.dtype(dtype)
            place += math.prod(self.shapes[name]) * np.dtype(dtype).itemsize
        found = output.seek(0, os.SEEK_END) - start
        if not place - start == found <= size:
            raise ValueError(
                f"its arrays declare {place - start} bytes and have {found}; the file has {size}"
            )

    def __contains__(self, name: str) -> bool:
        """Returns whether the file has such a group or array."""
        return name in self.attributes

    def read(self, name: str, *, finite: bool = True) -> NDArray[Any]:
        """Returns an array.

        Raises WeightsError when the file has no such array, and with `finite` for NaN or infinite
        numbers.
        """
        if name not in self.shapes:
            raise WeightsError(f"{self.path}: has no array {name}")
        place, dtype = self._places[name]
        self._output.seek(place)
        content = bytearray(self._output.read(math.prod(self.shapes[name]) * dtype.itemsize))
        array = np.frombuffer(content, dtype).reshape(self.shapes[name])
        with np.errstate(over="ignore"):  # a number too large for float32 becomes infinite
            if finite and not np.isfinite(array.astype(np.float32, copy=False)).all():
                raise WeightsError(f"{self.path}: {name} holds NaN or infinite numbers")
        return array


@contextlib.contextmanager
def open_h5(path: str | os.PathLike[str], shown: str | None = None) -> Iterator[H5File]:
    """Reads an `.h5` file, or the HDF5 file inside a `.keras` file, for the `with` block.

    The attribute `model_config` of a `.keras` file is its configuration. `shown` replaces the path
    in messages.

    Raises WeightsError when the file is missing, a folder, empty, of another kind, damaged, or
    harmful, or when no process can read it; also for damage that is found inside the `with` block.
    """
    place = os.fsdecode(path)
    name = place if shown is None else shown
    with report_damage(name), contextlib.ExitStack() as stack:
        if not Path(place).is_file():
            found = "not a file" if Path(place).exists() else "no such file"
            raise WeightsError(f"{name}: {found}; expected a weights file (.h5)")
        try:
            with open(place, "rb") as file:
                size = _size(file, name)
                output = stack.enter_context(tempfile.TemporaryFile())
                _run_reader(file, output, SECONDS + size / 2**25)
        except OSError as error:
            raise WeightsError(f"{name}: cannot be read ({error})") from error
        yield H5File(name, output, size)


@contextlib.contextmanager
def report_damage(path: str | os.PathLike[str]) -> Iterator[None]:
    """Raises WeightsError for an error in the `with` block, which uses the values of a file."""
    try:
        yield
    except UserError:
        raise
    except _DAMAGE as error:
        raise WeightsError(
            f"{os.fsdecode(path)}: cannot be read, the file is damaged ({error})"
        ) from error


def _size(file: IO[bytes], path: str) -> int:
    """Returns the size of a file. Raises WeightsError when it cannot hold weights, or is locked."""
    size = os.fstat(file.fileno()).st_size
    if not size:
        raise WeightsError(f"{path}: the file is empty; expected a weights file (.h5)")
    if size > LARGEST_FILE:
        raise WeightsError(f"{path}: larger than 1 GiB, the limit of a weights file")
    if sys.platform != "win32":
        import fcntl

        try:  # HDF5 locks a file that it writes
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise WeightsError(
                f"{path}: another program has opened the file for writing; close it there, or try "
                "again later"
            ) from error
        except OSError:  # a file system without locks
            pass
    return size


def _run_reader(file: IO[bytes], output: IO[bytes], seconds: float) -> None:
    """Runs `hdf5_reader`, with limited processor time in seconds, until it ends.

    Raises OSError when the process does not start, and ValueError when it does not end well.
    """
    # The process must find the modules where this one has found them.
    search_path = os.pathsep.join([*filter(None, sys.path), str(Path(__file__).parents[2])])
    try:
        status = subprocess.run(
            [sys.executable, *_READER, str(seconds)],
            stdin=file,
            stdout=output,
            stderr=subprocess.DEVNULL,
            timeout=_SECONDS_BY_THE_CLOCK + seconds,
            check=False,
            # Ctrl-C in the terminal is for this process alone. Windows needs the second option.
            start_new_session=True,
            creationflags=getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0),
            env={**os.environ, "PYTHONPATH": search_path, "OPENBLAS_NUM_THREADS": "1"},
        ).returncode
    except subprocess.TimeoutExpired as error:
        raise ValueError(f"reading it takes more than {error.timeout:.0f} s") from error
    if status == 1:  # Python's own error, such as a missing module
        raise OSError(f"{sys.executable} {' '.join(_READER)} does not start")
    end = signal.Signals(-status).name if status < 0 else f"status {status}"
    if end == "SIGPROF":  # see `hdf5_reader`
        raise ValueError(f"reading it takes more than {seconds:.0f} s of processor time")
    if status:
        raise ValueError(f"the process that read it ended with {end}")
