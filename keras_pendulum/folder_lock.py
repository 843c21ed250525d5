"""One run or study at a time in a folder."""

from __future__ import annotations

import contextlib
import fcntl
import os
from collections.abc import Iterator
from pathlib import Path

from keras_pendulum.errors import UserError


@contextlib.contextmanager
def held(folder: Path) -> Iterator[None]:
    """Keeps others out of the folder meanwhile; the system lets go of a killed process's.

    Raises UserError when another process holds it.
    """
    descriptor = os.open(folder, os.O_RDONLY)
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
    try:
        yield
    finally:
        os.close(descriptor)
