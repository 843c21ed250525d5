"""Writing a file so that whoever reads it sees the old one or the new one, whole."""

from __future__ import annotations

import os
import uuid
from collections.abc import Callable
from pathlib import Path

from keras_pendulum.errors import UserError


def write_atomically(
    path: str | os.PathLike[str], *parts: bytes, check: Callable[[Path], object] = lambda file: None
) -> None:
    """Puts the parts at `path`: written beside it, flushed to the disk, and swapped in.

    Args:
        path: the file.
        parts: what it is to hold.
        check: called with the new file before it is swapped in; what it raises comes out.

    Raises UserError when the file system refuses; an old file at `path` is then unharmed.
    """
    target = Path(os.path.realpath(path))
    fresh = target.with_name(f".{target.name}.{uuid.uuid4().hex}.tmp")
    try:
        if target.is_dir():
            raise IsADirectoryError(None, "it is a folder")
        try:
            with open(fresh, "xb") as file:
                file.writelines(parts)
                file.flush()
                os.fsync(file.fileno())
            check(fresh)
            fresh.replace(target)
        finally:
            fresh.unlink(missing_ok=True)
    except OSError as error:
        raise UserError(f"cannot write {path}: {error.strerror or error}") from error


def require_no_other_file(path: Path, beginning: bytes, kind: str) -> None:
    """Raises UserError when `path` holds something else than a file that begins so, `kind`.

    A slip of the shell's completion would else put what a command makes in place of the weights
    that it makes it of.
    """
    try:
        if path.is_file():
            with open(path, "rb") as file:
                other = file.read(len(beginning)) != beginning
        else:  # a folder cannot be written either, which is told where it is tried
            other = path.exists() and not path.is_dir()
    except OSError as error:
        raise UserError(f"cannot write {path}: {error.strerror}") from error
    if other:
        raise UserError(f"{path} holds something else than {kind}: name another file")
