"""Atomic writing: a reader finds the whole old file or the whole new file."""

from __future__ import annotations

import contextlib
import os
import sys
import time
import uuid
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from keras_pendulum.errors import UserError, report_os_error

_RETRIES, _SECONDS_BETWEEN = 40, 0.05  # 2 s in all
_Result = TypeVar("_Result")


def write_atomically(
    path: str | os.PathLike[str], *parts: bytes, check: Callable[[Path], object] = lambda file: None
) -> None:
    """Writes a temporary file, flushes it to the disk, and replaces the file at `path` with it.

    Then it flushes the folder, so that the new file is there after a power failure.

    Args:
        path: the file.
        parts: the content, in order.
        check: called with the temporary file; if it raises, the old file is unchanged.

    Raises UserError when the file system refuses, or when something else than a file is at `path`,
    such as a folder, a pipe or a device. What is at `path` is then unchanged.
    """
    if not os.fspath(path):
        raise UserError("the name of the file is empty")
    target = Path(os.path.realpath(path))
    # Short, because systems limit the length of a name, and Windows that of a path.
    temporary = target.with_name(f".{target.name[:60]}.{uuid.uuid4().hex[:8]}.tmp")
    with report_os_error(f"cannot write {path}"):
        if Path(path).exists() and not target.is_file():
            kind = "a folder" if target.is_dir() else "a device, a pipe or a socket"
            raise OSError(None, f"it is {kind}; name a file")
        try:
            with open(temporary, "xb") as file:
                file.writelines(parts)
                file.flush()
                os.fsync(file.fileno())
            check(temporary)
            retry_while_open(lambda: temporary.replace(target))
        finally:
            with contextlib.suppress(OSError):  # it is gone, or the error above says more
                temporary.unlink()
    with contextlib.suppress(OSError):  # the new file is in place, and not every system can do it
        _flush_folder(target.parent)


def retry_while_open(action: Callable[[], _Result]) -> _Result:
    """Returns the result of `action`, which opens, replaces or removes a file.

    Windows refuses that while another program has the file open, such as a spreadsheet or a virus
    scanner. There, the action is repeated for 2 s.

    Raises OSError as the action does; on Windows, a PermissionError says what to do.
    """
    if sys.platform != "win32":
        return action()
    for _ in range(_RETRIES):
        with contextlib.suppress(PermissionError):
            return action()
        time.sleep(_SECONDS_BETWEEN)
    try:
        return action()
    except PermissionError as error:
        raise PermissionError(
            error.errno,
            "another program has the file open, or it is read-only; close it there, and run the "
            "command again",
        ) from error


def _flush_folder(folder: Path) -> None:
    if sys.platform == "win32":  # it cannot open a folder
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def require_no_other_file(path: Path, beginning: bytes, kind: str, offset: int = 0) -> None:
    """Raises UserError when `path` exists and its content does not start with `beginning`.

    Raises it for a path in a folder that does not exist, too.

    A wrong completion in the shell could otherwise replace the weights by the output of a command.

    Args:
        path: the file to write.
        beginning: the first bytes of every file of this kind.
        kind: the kind of file, for the message, such as "a GIF".
        offset: place of `beginning`, where other bytes are before it.
    """
    with report_os_error(f"cannot write {path}"):
        if not path.parent.is_dir():
            raise UserError(f"cannot write {path}: there is no folder {path.parent}")
        if path.is_file():
            with open(path, "rb") as file:
                is_other = file.read(offset + len(beginning))[offset:] != beginning
        else:  # writing to a folder fails later, with its own message
            is_other = path.exists() and not path.is_dir()
    if is_other:
        raise UserError(f"{path} holds something else than {kind}: name another file")
