"""One run or study at a time in a folder."""

from __future__ import annotations

import contextlib
import fcntl
import os
from collections.abc import Callable, Iterator
from pathlib import Path

from keras_pendulum.errors import UserError


@contextlib.contextmanager
def held(folder: Path) -> Iterator[Callable[[], None]]:
    """Keeps others out of the folder meanwhile; the system lets go of a killed process's.

    What it gives raises UserError once the folder is not at this path any more: the lock goes where
    the folder is moved, and what is written to its path would be another's.

    Raises UserError when another process holds it, or it cannot be read.
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
            f"another run is going on in {folder}: wait for its end, or name another folder "
            "by --out"
        ) from error
    except OSError:  # a file system without locks
        pass

    def require_in_place() -> None:
        try:
            moved = not os.path.samestat(folder.stat(), os.fstat(descriptor))
        except OSError:
            moved = True
        if moved:
            raise UserError(f"{folder} was moved, removed or replaced: nothing more is written")

    try:
        yield require_in_place
    finally:
        os.close(descriptor)
