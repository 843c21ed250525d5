"""The files of returns: those of the package, and those in the user's cache folder.

A file contains the returns for one gravity, one episode length and one discount, by reset seed. The
returns of discount 1 are optimal. Those of a smaller one are the undiscounted returns of the policy
that is optimal for it.
"""

from __future__ import annotations

import contextlib
import io
import math
import os
from collections.abc import Callable, Iterable
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.environments.actions import MAX_TORQUE
from keras_pendulum.environments.tasks import STEPS_PER_EPISODE
from keras_pendulum.errors import UserError
from keras_pendulum.optimum.dynamics import MAX_SPEED
from keras_pendulum.storage.atomic_write import write_atomically

LOWEST_REWARD = -(math.pi**2 + 0.1 * MAX_SPEED**2 + 0.001 * MAX_TORQUE**2)


def stored_returns(
    seeds: Iterable[int],
    compute: Callable[[list[int]], NDArray[np.float64]],
    usual_seeds: range,
    gravity: float,
    steps: int,
    discount: float = 1.0,
) -> NDArray[np.float64]:
    """Returns the returns of the seeds; those that no file contains are computed and stored.

    Args:
        seeds: reset seeds.
        compute: returns the returns of a list of seeds.
        usual_seeds: are computed together with the first missing seed.
        gravity: m/s².
        steps: steps per episode.
        discount: γ.
    """
    seeds, key = list(seeds), (gravity, steps, discount)
    returns = read(shipped_file(*key), *key)  # by seed
    if not returns.keys() >= set(seeds):
        cache = cache_file(*key)
        cached = read(cache, *key) if cache else {}
        returns |= cached
        missing = sorted(set(seeds) - returns.keys())
        if missing:
            missing = sorted({*missing, *usual_seeds} - returns.keys())
            computed = dict(zip(missing, compute(missing).tolist(), strict=True))
            returns |= computed
            with contextlib.suppress(OSError, UserError):  # the cache only saves time
                if cache:
                    cache.parent.mkdir(parents=True, exist_ok=True)
                    write(cache, *key, returns=cached | computed)
    return np.array([returns[seed] for seed in seeds], np.float64)


def shipped_file(gravity: float, steps: int, discount: float = 1.0) -> Path:
    """Returns the path of the package's file; the file may not exist."""
    data = Path(str(resources.files("keras_pendulum.optimum"))) / "data"
    return data / file_name(gravity, steps, discount)


def cache_file(gravity: float, steps: int, discount: float = 1.0) -> Path | None:
    """Returns the path in the user's cache folder, or None for a user without a home folder."""
    folder = cache_folder()
    return folder / file_name(gravity, steps, discount) if folder else None


def cache_folder() -> Path | None:
    """Returns the user's cache folder, or None for a user without a home folder."""
    try:
        base = os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser()
    except RuntimeError:
        return None
    return Path(base) / "keras_pendulum"


def file_name(gravity: float, steps: int, discount: float = 1.0) -> str:
    """Returns a name such as `gravity_10.npz`, `gravity_10_steps_40.npz` or
    `gravity_10_discount_0.985.npz`.
    """
    name = f"gravity_{str(gravity).removesuffix('.0')}"
    name += "" if steps == STEPS_PER_EPISODE else f"_steps_{steps}"
    name += "" if discount == 1 else f"_discount_{str(discount).removesuffix('.0')}"
    return f"{name}.npz"


def write(
    path: Path, gravity: float, steps: int, discount: float = 1.0, *, returns: dict[int, float]
) -> None:
    """Writes returns by seed. Raises UserError when the file cannot be written."""
    buffer = io.BytesIO()
    seeds = sorted(returns)
    optional: dict[str, Any] = {} if steps == STEPS_PER_EPISODE else {"steps": np.int64(steps)}
    optional |= {} if discount == 1 else {"discount": np.float64(discount)}
    np.savez_compressed(
        buffer,
        gravity=np.float64(gravity),
        seeds=np.array(seeds, np.int64),
        returns=np.array([returns[seed] for seed in seeds], np.float64),
        **optional,
    )
    write_atomically(path, buffer.getvalue())


def read(path: Path, gravity: float, steps: int, discount: float = 1.0) -> dict[int, float]:
    """Returns the returns by seed.

    The result is empty if the file is missing, damaged, or of another gravity, episode length or
    discount.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            file_gravity, seeds, returns = file["gravity"], file["seeds"], file["returns"]
            file_steps = file.get("steps", STEPS_PER_EPISODE)
            file_discount = file.get("discount", 1.0)
    except Exception:  # one flipped bit of an archive can raise any of seven exception types
        return {}
    valid = (
        (file_gravity.shape, file_gravity.dtype, seeds.dtype) == ((), np.float64, np.int64)
        and returns.dtype == np.float64
        and file_gravity == gravity
        and np.array_equal(file_steps, steps)
        and np.array_equal(file_discount, discount)
        and seeds.ndim == 1
        and seeds.shape == returns.shape
        and bool(((returns >= steps * LOWEST_REWARD) & (returns <= 0)).all())
    )
    return dict(zip(seeds.tolist(), returns.tolist(), strict=True)) if valid else {}
