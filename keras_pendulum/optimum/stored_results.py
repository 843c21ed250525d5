"""The files of exact results: those of the package, and those in the user's cache folder."""

from __future__ import annotations

import contextlib
import io
import logging
import os
from collections.abc import Callable
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.config.fields import Integer, Number
from keras_pendulum.environments.pendulum import STEPS_PER_EPISODE, Pendulum, validate_gravity
from keras_pendulum.errors import UserError
from keras_pendulum.storage.atomic_write import write_atomically

_log = logging.getLogger(__name__)

Arrays = dict[str, Any]  # arrays or numbers by name, as in a file
Result = TypeVar("Result")


class Problem(NamedTuple):
    """The problem of the pendulum that a result solves."""

    gravity: float  # m/s²
    steps: int  # of an episode
    discount: float  # γ; 1 for the highest undiscounted return

    @classmethod
    def valid(
        cls, gravity: float, steps: int = STEPS_PER_EPISODE, discount: float = 1.0
    ) -> Problem:
        """Returns the problem. Raises ConfigError for a number out of range."""
        return cls(
            validate_gravity(gravity),
            Integer(1, STEPS_PER_EPISODE).validate("steps", steps),
            Number(0, 1).validate("discount", discount) + 0.0,  # -0.0 becomes 0.0
        )

    @property
    def file_name(self) -> str:
        """The name of its file, such as `gravity_10_steps_40_discount_0.985.npz`."""
        name = f"gravity_{str(self.gravity).removesuffix('.0')}"
        name += "" if self.steps == STEPS_PER_EPISODE else f"_steps_{self.steps}"
        name += "" if self.discount == 1 else f"_discount_{str(self.discount).removesuffix('.0')}"
        return f"{name}.npz"


def read_returns(path: Path | None, problem: Problem) -> dict[int, float]:
    """Returns the returns by seed; none of a file of another problem, or that cannot be right."""
    arrays = arrays_of(read_arrays(path), problem, "seeds", "returns")
    if [array.dtype for array in arrays] != [np.int64, np.float64]:
        return {}
    seeds, returns = arrays
    valid = seeds.ndim == 1 and seeds.shape == returns.shape
    if not valid or not are_between(problem.steps * Pendulum.reward_range[0], returns):
        return {}
    return dict(zip(seeds.tolist(), returns.tolist(), strict=True))


def are_between(lowest: float, values: NDArray[Any]) -> bool:
    """Returns whether all values are from `lowest` to 0, as no reward is positive."""
    return bool(((values >= lowest) & (values <= 0)).all())  # false for NaN


def arrays_of(arrays: Arrays, problem: Problem, *names: str) -> list[NDArray[Any]]:
    """Returns the arrays of these names from those of a file, which also has its problem's fields.

    The result is empty when one is missing, or the file is of another problem.
    """
    # A file of 200 steps or of discount 1 may leave them out.
    found: Arrays = {"steps": STEPS_PER_EPISODE, "discount": 1.0, **arrays}
    if not found.keys() >= {*Problem._fields, *names}:
        return []
    own = all(np.array_equal(found[key], value) for key, value in problem._asdict().items())
    return [found[name] for name in names] if own else []


def read_arrays(path: Path | None) -> Arrays:
    """Returns the arrays of a file by name; none when it is missing or damaged."""
    if path is None:
        return {}
    try:
        with np.load(path, allow_pickle=False) as file:
            return dict(file)
    except Exception:  # one flipped bit of an archive can raise any of seven exception types
        return {}


def write_arrays(path: Path, arrays: Arrays) -> None:
    """Writes a file that `read_arrays` reads. Raises UserError when it cannot be written."""
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    write_atomically(path, buffer.getvalue())


def shipped_file(name: str) -> Path:
    """Returns the path of a file in the package; there need not be one."""
    return Path(str(resources.files("keras_pendulum.optimum"))) / "data" / name


def cache_file(name: str) -> Path | None:
    """Returns the path of a file in the user's cache folder; None for a user without a home."""
    try:
        base = os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser()
    except RuntimeError:
        return None
    return Path(base, "keras_pendulum", name)


def stored_or_computed(
    name: str,
    unpack: Callable[[Arrays], Result | None],
    compute: Callable[[], Result],
    pack: Callable[[Result], Arrays],
    what: str,
) -> Result:
    """Returns the result in a file of the package or of the cache, else a new one.

    Args:
        name: of the file.
        unpack: returns the result of a file's arrays; None where they cannot be right.
        compute: returns a new result, which is written to the cache.
        pack: returns the arrays of a file.
        what: is computed, and how long that takes.
    """
    for path in (shipped_file(name), cache_file(name)):
        if (found := unpack(read_arrays(path))) is not None:
            return found
    _log.warning("Computing %s", what)
    result = compute()
    write_to_cache(cache_file(name), pack(result))
    return result


def write_to_cache(path: Path | None, arrays: Arrays) -> None:
    """Writes a file of the cache for `read_arrays`, if it can be written: it only saves time."""
    if path is not None:
        with contextlib.suppress(OSError, UserError):
            path.parent.mkdir(parents=True, exist_ok=True)
            write_arrays(path, arrays)


def split_words(words: NDArray[np.uint16]) -> dict[str, NDArray[np.uint8]]:
    """Returns the two bytes of each number; they take less space in a file than the numbers do."""
    return {"high": (words >> 8).astype(np.uint8), "low": (words & 255).astype(np.uint8)}


def join_words(arrays: Arrays, shape: tuple[int, ...]) -> Any:
    """Returns the numbers [shape] of `split_words`, uint16; None where the arrays are others."""
    parts = [arrays.get(name) for name in ("high", "low")]
    if any(each is None or each.dtype != np.uint8 or each.shape != shape for each in parts):
        return None
    high, low = parts
    return (np.asarray(high, np.uint16) << 8) | np.asarray(low, np.uint16)
