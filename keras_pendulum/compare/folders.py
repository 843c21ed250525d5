"""The folders to compare: the checkpoint in each, and a name for it."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from keras_pendulum.environments.tasks import TASKS
from keras_pendulum.errors import UserError


def find_checkpoints(folders: Sequence[str]) -> list[Path]:
    """Returns the checkpoint of the run in each folder.

    Raises UserError for a folder that holds no run, and for one that is given twice.
    """
    checkpoints = [_find_checkpoint(Path(folder)) for folder in folders]
    first: dict[str, str] = {}
    for folder in folders:
        real = os.path.normcase(os.path.realpath(folder))
        if real in first:
            raise UserError(f"{first[real]} and {folder} are the same folder: name it once")
        first[real] = folder
    return checkpoints


def short_names(folders: Sequence[str]) -> list[str]:
    """Returns the names of the folders, with as many parents as make them different."""
    paths = [Path(os.path.realpath(folder)).parts for folder in folders]
    for length in range(1, max(map(len, paths))):
        names = ["/".join(parts[-length:]) for parts in paths]
        if len(set(names)) == len(names):
            return names
    return list(folders)


def _find_checkpoint(folder: Path) -> Path:
    """Returns the checkpoint of the run in a folder."""
    names = [task.weights_name for task in TASKS.values()]
    try:
        found = [folder / name for name in names if (folder / name).is_file()]
        if not found and not folder.is_dir():
            kind = "a file" if folder.exists() else "no such folder"
            raise UserError(f"{folder}: {kind}; expected the folder of a run")
    except OSError as error:
        raise UserError(f"{folder}: {error.strerror}; expected the folder of a run") from error
    if not found:
        raise UserError(f"{folder}: holds no run (no {' or '.join(names)})")
    if len(found) > 1:
        raise UserError(f"{folder}: holds {' and '.join(names)}: move one to another folder")
    return found[0]
