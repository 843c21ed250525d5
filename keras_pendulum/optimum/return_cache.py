"""The files of optimal returns: those of the package, and those in the user's cache folder.

A file contains the returns for one gravity and one episode length, by reset seed.
"""

from __future__ import annotations

import io
import math
import os
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from keras_pendulum.environments.actions import MAX_TORQUE
from keras_pendulum.environments.tasks import STEPS_PER_EPISODE
from keras_pendulum.optimum.dynamics import MAX_SPEED
from keras_pendulum.storage.atomic_write import write_atomically

LOWEST_REWARD = -(math.pi**2 + 0.1 * MAX_SPEED**2 + 0.001 * MAX_TORQUE**2)


def shipped_file(gravity: float, steps: int) -> Path:
    """Returns the path of the package's file; the file may not exist."""
    return Path(str(resources.files("keras_pendulum.optimum"))) / "data" / file_name(gravity, steps)


def cache_file(gravity: float, steps: int) -> Path | None:
    """Returns the path in the user's cache folder, or None for a user without a home folder."""
    try:
        base = os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser()
    except RuntimeError:
        return None
    return Path(base) / "keras_pendulum" / file_name(gravity, steps)


def file_name(gravity: float, steps: int) -> str:
    """Returns the name of a file, such as `gravity_10.npz` or `gravity_10_steps_60.npz`."""
    suffix = "" if steps == STEPS_PER_EPISODE else f"_steps_{steps}"
    return f"gravity_{str(gravity).removesuffix('.0')}{suffix}.npz"


def write(path: Path, gravity: float, steps: int, returns: dict[int, float]) -> None:
    """Writes returns by seed. Raises UserError when the file cannot be written."""
    buffer = io.BytesIO()
    seeds = sorted(returns)
    optional: dict[str, Any] = {} if steps == STEPS_PER_EPISODE else {"steps": np.int64(steps)}
    np.savez_compressed(
        buffer,
        gravity=np.float64(gravity),
        seeds=np.array(seeds, np.int64),
        returns=np.array([returns[seed] for seed in seeds], np.float64),
        **optional,
    )
    write_atomically(path, buffer.getvalue())


def read(path: Path, gravity: float, steps: int) -> dict[int, float]:
    """Returns the returns by seed.

    The result is empty if the file is missing, damaged, or of another gravity or episode length.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            file_gravity, seeds, returns = file["gravity"], file["seeds"], file["returns"]
            file_steps = file.get("steps", STEPS_PER_EPISODE)
    except Exception:  # one flipped bit of an archive can raise any of seven exception types
        return {}
    valid = (
        (file_gravity.shape, file_gravity.dtype, seeds.dtype) == ((), np.float64, np.int64)
        and returns.dtype == np.float64
        and file_gravity == gravity
        and np.array_equal(file_steps, steps)
        and seeds.ndim == 1
        and seeds.shape == returns.shape
        and bool(((returns >= steps * LOWEST_REWARD) & (returns <= 0)).all())
    )
    return dict(zip(seeds.tolist(), returns.tolist(), strict=True)) if valid else {}
