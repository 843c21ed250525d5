"""A lock on a folder, so that only one run or study writes in it."""

from __future__ import annotations

import contextlib
import fcntl
import os
from collections.abc import Callable, Iterator
from pathlib import Path

from keras_pendulum.errors import UserError


@contextlib.contextmanager
def lock_folder(folder: Path) -> Iterator[Callable[[], None]]:
    """Locks the folder for the `with` block. The system releases the lock of a killed process.

    Yields a function that raises UserError when another folder, or none, is at this path now: the
    lock moves with the folder, and writing to the path would change files of another run.

    Raises UserError when another process has the lock, or when the folder cannot be read.
    """
    try:
        descriptor = os.open(folder, os.O_RDONLY)
    except OSError as error:
        raise UserError(f"cannot read the folder {folder}: {error.strerror}") from error
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        os.close(descriptor)
        raise UserError(
            f"another run is writing in {folder}: wait until it ends, or name another folder "
            "with --out"
        ) from error
    except OSError:  # a file system without locks
        pass

    def require_not_moved() -> None:
        try:
            moved = not os.path.samestat(folder.stat(), os.fstat(descriptor))
        except OSError:
            moved = True
        if moved:
            raise UserError(f"{folder} was moved, removed or replaced: nothing more is written")

    try:
        yield require_not_moved
    finally:
        os.close(descriptor)
