"""Writing a file so that whoever reads it sees the old one or the new one, whole."""

from __future__ import annotations

import os
import uuid
from pathlib import Path

from keras_pendulum.errors import UserError


def write_atomically(path: str | os.PathLike[str], *parts: bytes) -> None:
    """Puts the parts at `path`: written beside it, flushed to the disk, and swapped in.

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
            fresh.replace(target)
        finally:
            fresh.unlink(missing_ok=True)
    except OSError as error:
        raise UserError(f"cannot write {path}: {error.strerror or error}") from error
