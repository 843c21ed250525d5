"""Errors that a user can correct; each message is one line."""

from __future__ import annotations

import contextlib
import math
import re
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from numpy.typing import NDArray

LONGEST = 300  # characters of a message
_TERMINAL_CODE = re.compile(r"\x1b\[[0-9;]{0,9}m")


class UserError(Exception):
    """A mistake of the user. The message says what was found and what to do."""

    def __str__(self) -> str:
        return one_line(super().__str__())


class ConfigError(UserError, ValueError):
    """A setting with a value that no run can have."""


class WeightsError(UserError, ValueError):
    """A weights file that cannot be read, or does not hold the expected network."""


class UnknownLayersError(WeightsError):
    """A network that is not a chain of Dense layers."""


@contextlib.contextmanager
def report_os_error(problem: str) -> Iterator[None]:
    """Raises UserError with the problem and its reason for an OSError in the `with` block."""
    try:
        yield
    except OSError as error:
        raise UserError(f"{problem}: {error.strerror or error}") from error


def require_type(name: str, value: object, expected: type | tuple[type, ...]) -> None:
    """Raises TypeError when the argument `name` has another type than expected."""
    if not isinstance(value, expected):
        types = expected if isinstance(expected, tuple) else (expected,)
        names = " or ".join(kind.__name__ for kind in types)
        raise TypeError(one_line(f"{name} is {value!r}; expected {names}"))


def require_finite(weights: Iterable[NDArray[Any]], largest: float = math.inf) -> None:
    """Raises UserError when a weight is NaN, infinite or beyond `largest`.

    `load_weights` rejects such a network.
    """
    import numpy as np

    if not all(np.isfinite(array).all() and np.abs(array).max() <= largest for array in weights):
        raise UserError(
            f"a weight is not finite, or beyond {largest:g}: learning has diverged; such a network "
            "is neither saved nor evaluated: try a smaller learning_rate"
        )


def did_you_mean(word: str, names: Iterable[str]) -> str:
    """Returns "; did you mean NAME?" with the name that resembles a mistyped word, or ""."""
    import difflib

    by_lower_case = {name.lower(): name for name in names}
    beginning = word[:LONGEST].lower()  # a much longer one takes long to compare
    found = [name for name in by_lower_case if len(beginning) > 2 and name.startswith(beginning)]
    found = sorted(found, key=len)  # the word itself is the first
    found += difflib.get_close_matches(beginning, by_lower_case, 1)
    return f"; did you mean {by_lower_case[found[0]]}?" if found else ""


def one_line(message: str) -> str:
    """Returns a message as one printable line of at most 300 characters.

    The name of a file or an attribute may hold line breaks and terminal codes; they are escaped.
    Of a long message, the middle is left out: its end says what to do.
    """
    line = "".join(
        character if character.isprintable() else character.encode("unicode_escape").decode()
        for character in message
    )
    if len(line) <= LONGEST:
        return line
    half = LONGEST // 2
    return f"{line[: half - 1]}…{line[-half:]}"


def reason_of(error: BaseException) -> str:
    """Returns the text of an error in one line, as plain as can be.

    Keras prints its reasons in bold, between empty lines, and all arguments behind them.
    """
    reason = " ".join(_TERMINAL_CODE.sub("", str(error)).split())
    return reason.partition(" Arguments received by")[0]
