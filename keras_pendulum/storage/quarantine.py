"""Reads HDF5 files through another process (`h5_process`), so that a hostile file harms only that.

The process starts with the first file and serves all later ones. When it crashes, takes too long or
exceeds its memory, the file is refused, and the next file gets a new process.
"""

from __future__ import annotations

import atexit
import contextlib
import json
import math
import os
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.errors import UserError, WeightsError

LARGEST_ANSWER = 2**20  # bytes of JSON: names, attributes, types and shapes
_SECONDS_TO_START = 120.0  # with a cold disk or a virus scanner
_NUMBERS = re.compile(r"[<>|][fiub][1248]")  # NumPy's names of the types of numbers


def seconds_for(file_size: int) -> float:
    """Returns the longest time in seconds for reading a file of `file_size` bytes."""
    return 8 + file_size / 2**25


class H5File:
    """The content of an open HDF5 file: attributes and arrays, by the path of their object in it.

    Attributes are numbers, strings and lists of them; None stands for anything else.
    """

    def __init__(self, path: str, process: _Process, size: int) -> None:
        self._path = path
        self._process = process
        self._seconds = seconds_for(size)
        content = process.ask(path, {"open": str(Path(path).absolute())}, self._seconds)
        self.attributes: dict[str, dict[str, Any]] = content["attributes"]
        self.shapes: dict[str, tuple[int, ...]] = {}  # of all arrays
        self._types: dict[str, np.dtype[Any]] = {}
        for name, (dtype, shape) in content["arrays"].items():
            if not _NUMBERS.fullmatch(dtype) or min(shape, default=0) < 0:
                raise ValueError(f"{name} has the type {dtype} and the shape {shape}")
            self._types[name] = np.dtype(dtype)
            self.shapes[name] = tuple(map(int, shape))
        declared = sum(math.prod(self.shapes[name]) * self._types[name].itemsize for name in self)
        if declared > size:
            raise ValueError(f"its arrays declare {declared} bytes; the file has {size}")

    def __contains__(self, name: str) -> bool:
        """Returns whether the file has such a group or array."""
        return name in self.attributes

    def __iter__(self) -> Iterator[str]:
        """Yields the paths of the arrays."""
        return iter(self.shapes)

    def read(self, name: str, *, finite: bool = True) -> NDArray[Any]:
        """Returns an array.

        Raises WeightsError when the file has no such array, and with `finite` for NaN or infinite
        numbers.
        """
        if name not in self.shapes:
            raise WeightsError(f"{self._path}: has no array {name}")
        array = np.empty(self.shapes[name], self._types[name])
        self._process.ask(self._path, {"read": name}, self._seconds, array)
        with np.errstate(over="ignore"):  # a number too large for float32 becomes infinite
            if finite and not np.isfinite(array.astype(np.float32, copy=False)).all():
                raise WeightsError(f"{self._path}: {name} holds NaN or infinite numbers")
        return array


@contextlib.contextmanager
def open_h5(path: str | os.PathLike[str]) -> Iterator[H5File]:
    """Opens an `.h5` file, or the HDF5 file inside a `.keras` file, for reading.

    The attribute `model_config` of a `.keras` file is its configuration.

    Raises WeightsError when the file is missing, a folder, empty, of another kind, damaged, or
    harmful; also for damage that is found inside the `with` block.
    """
    name = os.fsdecode(path)
    with _LOCK:
        process = _running_process()
        try:
            size = Path(name).stat().st_size
        except OSError:
            size = 0  # the process says what is wrong
        try:
            with report_damage(name):
                yield H5File(name, process, size)
        finally:
            process.close_file()


@contextlib.contextmanager
def report_damage(path: str | os.PathLike[str]) -> Iterator[None]:
    """Raises WeightsError for an error in the `with` block, which uses the values of a file."""
    try:
        yield
    except UserError:
        raise
    # Which error a wrong value causes depends on the code that uses it.
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        raise WeightsError(
            f"{os.fsdecode(path)}: cannot be read, the file is damaged ({error})"
        ) from error


class _Process:
    """A process that reads files. The constructor raises UserError when it does not start."""

    def __init__(self) -> None:
        # The process must find the modules where this one has found them.
        search_path = os.pathsep.join(entry for entry in sys.path if entry)
        self._owner = os.getpid()
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", "keras_pendulum.storage.h5_process"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                start_new_session=True,  # Ctrl-C in the terminal is for this process alone
                env={**os.environ, "PYTHONPATH": search_path, "OPENBLAS_NUM_THREADS": "1"},
            )
        except OSError as error:
            raise UserError(f"cannot start a process to read the file: {error.strerror}") from error
        assert self._process.stdin and self._process.stdout
        self._requests: IO[bytes] = self._process.stdin
        self._answers: IO[bytes] = self._process.stdout
        try:
            self._receive(_SECONDS_TO_START, None)
        except (EOFError, ValueError) as error:
            raise UserError(f"cannot start a process to read the file: {error}") from error

    def ask(
        self, path: str, request: dict[str, Any], seconds: float, array: NDArray[Any] | None = None
    ) -> dict[str, Any]:
        """Returns the answer to a request.

        Args:
            path: the file, for messages.
            request: see `h5_process`.
            seconds: the longest time to wait.
            array: is filled with the bytes that follow the answer.

        Raises WeightsError when the process refuses the file, or ends.
        """
        try:
            with contextlib.suppress(OSError):  # _receive reports the end of the process
                self._requests.write(json.dumps(request).encode() + b"\n")
                self._requests.flush()
            answer = self._receive(seconds, array)
        except (EOFError, ValueError) as error:
            raise WeightsError(f"{path}: cannot be read, the file is damaged ({error})") from error
        if "error" in answer:
            raise WeightsError(f"{path}: {answer['error']}")
        return answer

    def close_file(self) -> bool:
        """Closes the open file: Windows neither replaces nor removes an open one.

        Returns whether the process is alive. A fork does not use the process of its parent.
        """
        if self._owner != os.getpid() or self._process.poll() is not None:
            return False
        try:
            self.ask("", {"close": None}, seconds_for(0))
        except WeightsError:
            return False
        return True

    def stop(self) -> None:
        """Ends the process."""
        if self._owner == os.getpid():
            self._process.kill()
            self._process.wait()
            for pipe in (self._requests, self._answers):
                with contextlib.suppress(OSError):
                    pipe.close()

    def _receive(self, seconds: float, array: NDArray[Any] | None) -> dict[str, Any]:
        """Returns an answer. Raises EOFError or ValueError when there is none, or a wrong one."""
        clock = threading.Timer(seconds, self._process.kill)
        clock.start()
        try:
            size = int.from_bytes(_read_exactly(self._answers, bytearray(8)), "little")
            if size > LARGEST_ANSWER:
                raise ValueError(f"an answer of {size} bytes")
            answer: dict[str, Any] = json.loads(_read_exactly(self._answers, bytearray(size)))
            if array is not None and "error" not in answer and array.nbytes:
                _read_exactly(self._answers, array.reshape(-1).view(np.uint8).data)
        except EOFError as error:
            self.stop()
            timed_out = not clock.is_alive()
            raise EOFError(_reason(self._process.returncode, seconds, timed_out)) from error
        except BaseException:  # the rest of the answer is still to come
            self.stop()
            raise
        finally:
            clock.cancel()
        return answer


def _read_exactly(stream: IO[bytes], buffer: Any) -> Any:
    """Fills the buffer from the stream and returns it. Raises EOFError when the stream ends."""
    view = memoryview(buffer)
    while view:
        count = stream.readinto(view)  # type: ignore[attr-defined]
        if not count:
            raise EOFError
        view = view[count:]
    return buffer


def _reason(returncode: int, seconds: float, timed_out: bool) -> str:
    """Returns why the process ended."""
    if timed_out:
        return f"reading it takes more than {seconds:.0f} s"
    if returncode < 0:
        return f"the process that read it ended with {signal.Signals(-returncode).name}"
    return f"the process that read it ended with status {returncode}"


_LOCK = threading.RLock()
_PROCESS: list[_Process] = []  # the running one


def _running_process() -> _Process:
    """Returns the process of this one, a new one when there is none."""
    if not _PROCESS or not _PROCESS[0].close_file():
        _PROCESS[:] = [_Process()]
    return _PROCESS[0]


@atexit.register
def _stop() -> None:
    for process in _PROCESS:
        process.stop()
