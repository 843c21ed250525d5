"""Atomic writing: a reader finds the whole old file or the whole new file."""

from __future__ import annotations

import os
import uuid
from collections.abc import Callable
from pathlib import Path

from keras_pendulum.errors import UserError


def write_atomically(
    path: str | os.PathLike[str], *parts: bytes, check: Callable[[Path], object] = lambda file: None
) -> None:
    """Writes a temporary file, flushes it to the disk, and replaces the file at `path` with it.

    Args:
        path: the file.
        parts: the content, in order.
        check: called with the temporary file; if it raises, the old file is unchanged.

    Raises UserError when the file system refuses. The file at `path` is then unchanged.
    """
    target = Path(os.path.realpath(path))
    temporary = target.with_name(f".{target.name}.{uuid.uuid4().hex}.tmp")
    try:
        if target.is_dir():
            raise IsADirectoryError(None, "it is a folder")
        try:
            with open(temporary, "xb") as file:
                file.writelines(parts)
                file.flush()
                os.fsync(file.fileno())
            check(temporary)
            temporary.replace(target)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        raise UserError(f"cannot write {path}: {error.strerror or error}") from error


def require_no_other_file(path: Path, beginning: bytes, kind: str) -> None:
    """Raises UserError when `path` exists and its content does not start with `beginning`.

    A wrong completion in the shell could otherwise replace the weights by the output of a command.

    Args:
        path: the file to write.
        beginning: the first bytes of every file of this kind.
        kind: the kind of file, for the message, such as "a GIF".
    """
    try:
        if path.is_file():
            with open(path, "rb") as file:
                is_other = file.read(len(beginning)) != beginning
        else:  # writing to a folder fails later, with its own message
            is_other = path.exists() and not path.is_dir()
    except OSError as error:
        raise UserError(f"cannot write {path}: {error.strerror}") from error
    if is_other:
        raise UserError(f"{path} holds something else than {kind}: name another file")
