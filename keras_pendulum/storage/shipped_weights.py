"""The weights files that the package ships: their folder, names and returns.

Nothing here imports h5py or NumPy: `--help` and shell completion use it.
"""

from __future__ import annotations

import json
from importlib import resources
from pathlib import Path

from keras_pendulum.storage.small_files import read_small_file


def shipped_folder() -> Path:
    """Returns the folder of the files: `shipped_weights` in a wheel, `weights` in a checkout."""
    package = Path(str(resources.files("keras_pendulum")))
    in_wheel = package / "shipped_weights"
    return in_wheel if in_wheel.is_dir() else package.parent / "weights"


def shipped_returns() -> dict[str, float]:
    """Returns the mean return on 100 fixed starts by name, without `.h5`.

    Each file records the same number; `benchmarks.learning.preset_results` writes both.
    """
    try:
        # Some installers link the files of a package.
        text = read_small_file((shipped_folder() / "returns.json").resolve())
    except FileNotFoundError:  # a copy of the package alone
        return {}
    returns: dict[str, float] = json.loads(text)
    return returns


def shipped_names() -> list[str]:
    """Returns the names that `find_weights` finds, without `.h5`."""
    return list(shipped_returns())
