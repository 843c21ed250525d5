"""What tests/test_atomic_file.py kills: a process that does nothing but save."""

from __future__ import annotations

from keras_pendulum.atomic_file import write_atomically


def save_constantly(path: str, contents: list[bytes]) -> None:
    """Writes one content after the other, without an end."""
    while True:
        for content in contents:
            write_atomically(path, content)
