"""The answers of an agent, checked: torques, indices of torques, or Q-values."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from traceback import extract_tb
from typing import Any

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.environments.torque import MAX_TORQUE, ROUNDING
from keras_pendulum.errors import UserError, reason_of

_ONE_OUTPUT = (
    "if it is an actor, whose output is a torque, give lambda o: float(model(o[None])[0, 0])"
)
Batch = tuple[int, ...]  # (B,) for observations [B, 3], () for one observation [3]


class ActionError(UserError):
    """An agent's answer that is not an action. `row` is its row in the batch of observations."""

    def __init__(self, message: str, row: int = 0) -> None:
        super().__init__(message)
        self.row = row


def call_agent(function: Callable[..., Any], *values: Any, **options: Any) -> Any:
    """Returns what the user's function returns; its exception becomes an ActionError."""
    try:
        return function(*values, **options)
    except (UserError, KeyboardInterrupt):
        raise
    except BaseException as error:
        raise ActionError(f"the agent {failure(error)}") from error


def failure(error: BaseException) -> str:
    """Returns what a user's code raised, and where."""
    frame = extract_tb(error.__traceback__)[-1]
    place = f"{Path(frame.filename).name}, line {frame.lineno}"
    return f"raised {type(error).__name__}: {reason_of(error)} ({place})"


def torques_of(answer: Any, batch: Batch) -> NDArray[np.float64]:
    """Returns the torques in N·m of the shape `batch`. Raises ActionError for anything else."""
    each = f" for each of {batch[0]} observations" if batch else ""
    numbers = _numbers(
        answer, batch, f"expected a torque in N·m{each}; for Q-values, give kp.q_function(…)"
    )
    if numbers.dtype.kind in "iu":
        raise _wrong(
            f"the integer {numbers.flat[0]}",
            "expected a torque as a floating-point number; for an index, give the torques that the "
            "indices stand for (torques=, --torques)",
        )
    torques = numbers.astype(np.float64)
    valid = np.abs(torques) <= MAX_TORQUE + ROUNDING  # false for NaN too
    if not valid.all():
        row = int(valid.argmin())
        raise _wrong(f"the torque {torques.flat[row]} N·m", "expected a number from -2 to 2", row)
    return torques.clip(-MAX_TORQUE, MAX_TORQUE)


def indices_of(answer: Any, batch: Batch, count: int, first: int) -> NDArray[np.intp]:
    """Returns the indices of `count` actions, from 0, of the shape `batch`.

    The integer `first` of the answer stands for index 0. Raises ActionError for anything else.
    """
    expected = f"expected an integer from {first} to {first + count - 1}"
    integers = _numbers(answer, batch, expected)
    if integers.dtype.kind not in "iu":
        raise _wrong(f"a number of the type {integers.dtype}", expected)
    valid = (integers >= first) & (integers < first + count)
    if not valid.all():
        row = int(valid.argmin())
        raise _wrong(f"the index {integers.flat[row]}", expected, row)
    return integers.astype(np.intp) - first


def q_values_of(answer: Any, batch: int, count: int | None = None) -> NDArray[Any]:
    """Returns Q-values [B, A] for B observations. Raises ActionError for anything else.

    `count` is A, where it is known.
    """
    expected = f"expected Q-values of the shape [{batch}, {count or 'number of torques'}]"
    values = _array(answer, expected)
    if values.shape == (batch, 1):
        raise _wrong("one number for each observation", f"{expected}; {_ONE_OUTPUT}")
    if values.shape != (batch, count or values.size // batch):
        raise _wrong(f"an array of the shape {list(values.shape)}", expected)
    return values


def best_of(q_values: NDArray[Any]) -> NDArray[np.intp]:
    """Returns the index [B] of the highest Q-value of each row [B, A].

    Raises ActionError for a value that is not finite.
    """
    finite = np.isfinite(q_values).all(axis=1)
    if not finite.all():
        raise ActionError("the agent returned a Q-value that is not finite", int(finite.argmin()))
    return q_values.argmax(axis=1)


def _numbers(answer: Any, batch: Batch, expected: str) -> NDArray[Any]:
    """Returns one number for each observation."""
    numbers = _array(answer, expected)
    if numbers.shape not in (batch, (*batch, 1)) and (batch or numbers.size != 1):
        raise _wrong(f"an array of the shape {list(numbers.shape)}", expected)
    return numbers.reshape(batch)


def _array(value: Any, expected: str) -> NDArray[Any]:
    """Returns a value of NumPy, PyTorch, TensorFlow, JAX or Python as an array of real numbers."""
    try:
        array = np.asarray(plain_array(value))
    except (TypeError, ValueError, RuntimeError, AttributeError) as error:
        raise _wrong(f"a {name_of(type(value))}", expected) from error
    if array.dtype.kind not in "fiu":
        raise _wrong(f"a {name_of(type(value))} of the type {array.dtype}", expected)
    return array


def plain_array(value: Any) -> Any:
    """Returns a value of PyTorch or TensorFlow as an array of NumPy, and another one as it is."""
    if hasattr(value, "detach"):
        value = value.detach().cpu()
        if value.is_floating_point() and value.itemsize < 4:
            value = value.float()  # NumPy has no bfloat16
    return value.numpy() if hasattr(value, "numpy") else value


def _wrong(found: str, expected: str, row: int = 0) -> ActionError:
    return ActionError(f"the agent returned {found}; {expected}", row)


def is_instance(value: object, module: str, name: str) -> bool:
    """Returns whether the value is of a class of a library, which is not imported for it."""
    return isinstance(value, getattr(sys.modules.get(module), name, ()))


def name_of(value: object) -> str:
    """Returns a function's own name, else the name of the object's class."""
    name = getattr(value, "__name__", None)
    return name if isinstance(name, str) else type(value).__name__
