"""Reads small files, such as JSON, and refuses links and devices where a run or a study writes."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from keras_pendulum.errors import UserError

_LARGEST = 2**22  # bytes; the result of a study's run with 1 000 000 episodes has half of it
# Opening a pipe waits for a writer, and a link may have replaced the file since it was checked.
_FLAGS = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOFOLLOW", 0)


def read_small_file(path: Path) -> bytes:
    """Returns the content of a regular file.

    Raises UserError for a link, a device, a pipe or a folder, and for more than 4 MiB. Raises
    OSError as `open` does, such as FileNotFoundError.
    """
    require_regular(path)
    with open(path, "rb", opener=lambda name, flags: os.open(name, flags | _FLAGS)) as file:
        if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            raise _not_regular(path, "file")
        content = file.read(_LARGEST + 1)
    if len(content) > _LARGEST:
        raise UserError(f"{path} is larger than {_LARGEST >> 20} MiB, the limit: remove the file")
    return content


def require_regular(*files: Path) -> None:
    """Raises UserError for a link, a folder or a device in place of a file; it may be missing."""
    for file in files:
        mode = _mode(file)
        if mode is not None and not stat.S_ISREG(mode):
            raise _not_regular(file, "file")


def require_folder(*folders: Path) -> None:
    """Raises UserError for a link, a file or a device in place of a folder; it may be missing."""
    for folder in folders:
        mode = _mode(folder)
        if mode is not None and not stat.S_ISDIR(mode):
            raise _not_regular(folder, "folder")


def _mode(path: Path) -> int | None:
    """Returns the kind of what is at the path itself, also of a link; None where nothing is."""
    try:
        return path.lstat().st_mode
    except (FileNotFoundError, NotADirectoryError):  # the folder does not exist either
        return None


def _not_regular(path: Path, expected: str) -> UserError:
    other = "folder" if expected == "file" else "file"
    return UserError(
        f"{path} is a link, a {other} or a device; expected a {expected}: remove it, or name "
        "another folder with --out"
    )
