"""The weights files that the package ships: where they are, and the return that each records.

Nothing here imports h5py or NumPy: `--help` and shell completion use it.
"""

from __future__ import annotations

import struct
from importlib import resources
from pathlib import Path

_RETURN = b"evaluated_return\0"
# HDF5 pads the name to 24 bytes; then come 24 bytes of type and 8 of shape, and then the number.
_BYTES_BETWEEN = 24 - len(_RETURN) + 24 + 8


def shipped_folders() -> tuple[Path, Path]:
    """Returns the folders that may hold the files; a wheel has the first, a checkout the second."""
    package = Path(str(resources.files("keras_pendulum")))
    return package / "shipped_weights", package.parent / "weights"


def shipped_files() -> list[Path]:
    """Returns the paths of the shipped files, sorted by name."""
    for folder in shipped_folders():
        if files := sorted(folder.glob("*.h5")):
            return files
    return []


def shipped_names() -> list[str]:
    """Returns the names that `find_weights` finds, without `.h5`."""
    return [path.stem for path in shipped_files()]


def shipped_return(path: Path) -> float | None:
    """Returns the mean return that a shipped file records, or None.

    It is the attribute `evaluated_return`. Strangers' files are read by `weights.recorded_return`.
    """
    _, found, rest = path.read_bytes().rpartition(_RETURN)
    if not found or len(rest) < _BYTES_BETWEEN + 8:
        return None
    number: float = struct.unpack_from("<d", rest, _BYTES_BETWEEN)[0]
    return number
