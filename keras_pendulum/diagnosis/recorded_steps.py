"""The steps that a recorder has seen, and their file."""

from __future__ import annotations

import io
import math
import os
import stat
import zipfile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.errors import UserError, report_os_error
from keras_pendulum.storage.atomic_write import require_no_other_file, write_atomically

LARGEST_RECORD = 200_000  # steps
_LARGEST_FILE = 2**26  # bytes; 200 000 steps of Pendulum-v1 have 7 MB

Array = NDArray[Any]


class Steps(NamedTuple):
    """Recorded steps, episode by episode, oldest first; those of one environment after another."""

    observation: Array  # [N, D] float32
    action: Array  # [N] or [N, K] as the program gave it: float32 torques, or int64 indices
    reward: Array  # [N] float32
    next_observation: Array  # [N, D] float32
    terminated: Array  # [N] bool
    truncated: Array  # [N] bool
    first: Array  # [N] bool: whether the step is the first after a reset
    time: Array  # [N] int64: grows with each step of its environment
    total: Array  # [] int64: steps of the program, also those before the recorded ones


def write_steps(steps: Steps, path: str | os.PathLike[str]) -> None:
    """Writes steps to a file. Raises UserError as `Recorder.save` does."""
    if not len(steps.reward):
        raise UserError("the recorder has no step yet: save it after the training")
    require_no_other_file(Path(path), b"PK", "an .npz file")
    if Path(path).is_file() and not _holds_steps(path):  # .keras files and others are archives, too
        raise UserError(f"{path} holds something else than recorded steps: name another file")
    content = io.BytesIO()
    np.savez_compressed(content, **steps._asdict())
    write_atomically(path, content.getvalue())


def _holds_steps(path: str | os.PathLike[str]) -> bool:
    try:
        with zipfile.ZipFile(path) as archive:
            return {f"{name}.npy" for name in Steps._fields} <= {*archive.namelist()}
    except (OSError, zipfile.BadZipFile):
        return False


def read_steps(path: str) -> Steps:
    """Returns the steps in a file of `Recorder.save`. No code of the file runs.

    Raises UserError for a file that is missing, damaged, too large, or of another kind.
    """
    with (
        report_os_error(f"cannot read {path}"),
        open(path, "rb", opener=_open_without_waiting) as file,
    ):
        if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            raise UserError(f"{path} is not a file; expected the file of a recorder")
        content = file.read(_LARGEST_FILE + 1)
    if len(content) > _LARGEST_FILE:
        raise UserError(f"{path} is larger than {_LARGEST_FILE >> 20} MiB, the limit of a record")
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            steps = Steps(*(_read_array(archive, name) for name in Steps._fields))
    except Exception as error:  # damage causes any error of zipfile
        raise UserError(
            f"{path} is not the file of a recorder, or it is damaged ({error}): write it with "
            'recorder.save("run.npz")'
        ) from error
    rows = len(steps.reward)
    lengths = {len(column) for column in steps[:-1]}  # the last one is a number
    same = lengths == {rows} and steps.observation.shape == steps.next_observation.shape
    if not same or rows > LARGEST_RECORD:
        raise UserError(f"{path} is damaged: its columns do not have the same number of rows")
    numbers = steps.observation, steps.next_observation, steps.action, steps.reward
    if not all(np.isfinite(column).all() for column in numbers):
        raise UserError(f"{path} has NaN or infinite numbers; expected finite ones")
    return steps


def _open_without_waiting(path: str, flags: int) -> int:
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))  # a pipe waits for a writer


# Kinds and numbers of dimensions that each column may have.
_COLUMNS: dict[str, tuple[str, tuple[int, ...]]] = {
    "observation": ("f", (2,)),
    "action": ("if", (1, 2)),
    "reward": ("f", (1,)),
    "next_observation": ("f", (2,)),
    "terminated": ("b", (1,)),
    "truncated": ("b", (1,)),
    "first": ("b", (1,)),
    "time": ("i", (1,)),
    "total": ("i", (0,)),
}


def _read_array(archive: zipfile.ZipFile, name: str) -> Array:
    """Returns a column; its declared size is checked before its memory is taken."""
    member = archive.getinfo(f"{name}.npy")
    if member.file_size > _LARGEST_FILE:
        raise ValueError(f"{name} has {member.file_size} bytes")
    with archive.open(member) as file:
        content = io.BytesIO(file.read(_LARGEST_FILE))
    np.lib.format.read_magic(content)
    shape, _, kind = np.lib.format.read_array_header_1_0(content)  # as `write_steps` writes it
    kinds, dimensions = _COLUMNS[name]
    if kind.kind not in kinds or len(shape) not in dimensions:
        raise ValueError(f"{name} has the type {kind} and the shape {list(shape)}")
    if math.prod(shape) * kind.itemsize > len(content.getbuffer()):
        raise ValueError(f"{name} has fewer numbers than its shape {list(shape)}")
    content.seek(0)
    return np.asarray(np.lib.format.read_array(content, allow_pickle=False))
