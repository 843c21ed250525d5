"""A lock on a folder, so that only one run or study writes in it."""

from __future__ import annotations

import contextlib
import errno
import os
from collections.abc import Callable, Iterator
from pathlib import Path

from filelock import FileLock, Timeout

from keras_pendulum.errors import UserError

LOCK_FILE = ".lock"
# The errors of a file system without locks.
_WITHOUT_LOCKS = {errno.ENOSYS, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOLCK, errno.EINVAL}


@contextlib.contextmanager
def lock_folder(folder: Path) -> Iterator[Callable[[], None]]:
    """Locks the folder for the `with` block, by a lock on the file `.lock` in it.

    The system releases the lock of a killed process. The file is removed at the end; a killed
    process leaves it, and the next one uses it. On a file system without locks there is no lock.

    Yields a function that raises UserError when another folder, or none, is at this path now: the
    lock moves with the folder, and writing to the path would change files of another run.

    Raises UserError when another run has the lock, or when the folder is read-only.
    """
    file = folder / LOCK_FILE
    lock = FileLock(file, blocking=False, fallback_to_soft=False)
    try:
        lock.acquire()
    except Timeout as error:
        raise UserError(
            f"another run is writing in {folder}: wait until it ends, or name another folder "
            "with --out"
        ) from error
    except OSError as error:
        if error.errno not in _WITHOUT_LOCKS:
            raise UserError(f"cannot write {file}: {error.strerror or error}") from error
        with contextlib.suppress(OSError):
            file.unlink()
    # The open file keeps its number, so no other file gets it.
    watched = file if lock.is_locked else folder
    before = watched.stat()

    def is_moved() -> bool:
        try:
            return not os.path.samestat(watched.stat(), before)
        except OSError:
            return True

    def require_not_moved() -> None:
        if is_moved():
            raise UserError(
                f"{folder}, or the file {LOCK_FILE} in it, was moved, removed or replaced: nothing "
                "more is written"
            )

    try:
        yield require_not_moved
    finally:
        if lock.is_locked and not is_moved():
            # Before the release: after it, the file may be the lock of another run. Windows removes
            # no open file; there FileLock removes it.
            with contextlib.suppress(OSError):
                file.unlink()
        lock.release()
