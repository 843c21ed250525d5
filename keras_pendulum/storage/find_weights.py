"""The path of a weights file: the user's own, or one that the package ships."""

from __future__ import annotations

import os
from pathlib import Path

from keras_pendulum.environments.tasks import TASKS
from keras_pendulum.errors import WeightsError, did_you_mean
from keras_pendulum.storage.foreign_files import refuse_foreign
from keras_pendulum.storage.shipped_weights import shipped_folder, shipped_names


def find_weights(name: str | os.PathLike[str]) -> Path:
    """Returns the path of a weights file.

    `name` is the file, a run folder, or the name of a shipped file.

    Raises WeightsError when none of them exists, and for the file of another library.

    >>> kp.find_weights("reference").name
    'reference.h5'
    """
    name = os.fspath(name)
    if not name:
        raise WeightsError("the name of the weights file is empty")
    path = Path(name)
    try:
        if path.is_file():
            refuse_foreign(path)
            return path
        if len(checkpoints := checkpoints_in(path)) == 1:
            return path / checkpoints[0]
    except OSError as error:  # a name that no file can have
        raise WeightsError(f"{name}: {error.strerror}; expected a weights file (.h5)") from error
    shipped = name.removesuffix(".h5")
    if shipped in shipped_names():
        return shipped_folder() / f"{shipped}.h5"
    if path.is_dir():
        refuse_foreign(path)
        files = sorted(file.name for file in path.glob("*.h5"))
        example = f", such as {path / files[0]}" if files else ""
        raise WeightsError(
            f"{name}: a folder without a run; expected a weights file (.h5){example}"
        )
    problem = "not a file" if path.exists() else "no such file"
    beside = (str(each) for each in path.parent.glob("*"))
    meant = did_you_mean(name, [*shipped_names(), *beside])
    raise WeightsError(f"{name}: {problem}; expected a weights file (.h5){meant}")


def checkpoints_in(folder: Path) -> list[str]:
    """Returns the names of the checkpoints in the folder of a run. Raises OSError as it is read."""
    names = [task.weights_name for task in TASKS.values()]
    return [name for name in names if (folder / name).is_file()]
