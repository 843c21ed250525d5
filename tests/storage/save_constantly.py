"""A process that only saves; test_atomic_write_posix.py kills it."""

from __future__ import annotations

from keras_pendulum.storage.atomic_write import write_atomically


def save_constantly(path: str, contents: list[bytes]) -> None:
    """Writes each of the contents to `path`, again and again."""
    while True:
        for content in contents:
            write_atomically(path, content)
