"""Reads small files, such as JSON, and refuses links and devices where a run or a study writes."""

from __future__ import annotations

import os
import stat
from collections.abc import Callable, Iterable
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
    _require(files, stat.S_ISREG, "file")


def require_folder(*folders: Path) -> None:
    """Raises UserError for a link, a file or a device in place of a folder; it may be missing."""
    _require(folders, stat.S_ISDIR, "folder")


def _require(paths: Iterable[Path], is_right: Callable[[int], bool], expected: str) -> None:
    for path in paths:
        try:
            mode = path.lstat().st_mode  # of a link itself
        except (FileNotFoundError, NotADirectoryError):  # the folder does not exist either
            continue
        if not is_right(mode):
            raise _not_regular(path, expected)


def _not_regular(path: Path, expected: str) -> UserError:
    other = "folder" if expected == "file" else "file"
    return UserError(
        f"{path} is a link, a {other} or a device; expected a {expected}: remove it, or name "
        "another folder with --out"
    )
