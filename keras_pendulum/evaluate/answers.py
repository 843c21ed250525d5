"""The answers of an agent, checked: torques, indices of torques, or Q-values."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from traceback import extract_tb
from typing import Any

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.environments.actions import MAX_TORQUE
from keras_pendulum.errors import UserError

# Two states to try an agent with, one with each sign.
EXAMPLES = np.array([[1, 0, 0.5], [-0.6, -0.8, -3]], np.float32)  # [2, 3]


class ActionError(UserError):
    """An agent's answer that is no action. `row` is its row in the batch of observations."""

    def __init__(self, message: str, row: int = 0) -> None:
        super().__init__(message)
        self.row = row


def torques_of(function: Callable[[Any], Any], observations: Any) -> NDArray[np.float64]:
    """Returns the torques, float64 [B], or [] for one observation [3].

    Raises ActionError for an answer that is no torque for each observation.
    """
    batch = np.shape(observations)[:-1]
    expected = f"expected a torque in N·m{f' for each of {batch[0]} observations' if batch else ''}"
    torques = as_array(call_agent(function, observations), expected)
    if torques.shape not in (batch, (*batch, 1)):
        raise ActionError(
            f"the agent returned an array of the shape {list(torques.shape)}; {expected}"
        )
    torques = torques.astype(np.float64).reshape(batch)
    valid = np.atleast_1d(np.abs(torques) <= MAX_TORQUE)  # false for NaN too
    if not valid.all():
        row = int(valid.argmin())
        torque = np.atleast_1d(torques)[row]
        raise ActionError(
            f"the agent returned the torque {torque:g} N·m; expected a number from -2 to 2", row
        )
    return torques


def checked_indices(
    answer: Any, batch: tuple[int, ...], count: int, first: int
) -> NDArray[np.intp]:
    """Returns the indices of torques. Raises ActionError for other numbers."""
    expected = f"expected an integer from {first} to {first + count - 1}"
    indices = as_array(answer, expected)
    if indices.dtype.kind not in "iu":
        raise ActionError(f"the agent returned a number of the type {indices.dtype}; {expected}")
    if indices.shape not in (batch, (*batch, 1)):
        raise ActionError(
            f"the agent returned an array of the shape {list(indices.shape)}; {expected}"
        )
    positions = indices.reshape(batch).astype(np.intp) - first
    valid = np.atleast_1d((positions >= 0) & (positions < count))
    if not valid.all():
        row = int(valid.argmin())
        index = np.atleast_1d(positions)[row] + first
        raise ActionError(f"the agent returned the index {index}; {expected}", row)
    return positions


def checked_values(
    function: Callable[[Any], Any], observations: NDArray[np.float32], count: int | None = None
) -> NDArray[Any]:
    """Returns the Q-values [B, A] that a function returns. Raises ActionError for anything else."""
    batch = len(observations)
    expected = f"expected Q-values of the shape [{batch}, {count or 'number of torques'}]"
    values = as_array(call_agent(function, observations), expected)
    shape: Sequence[int] = values.shape
    if len(shape) != 2 or shape[0] != batch or shape[1] != (count or shape[1]) or shape[1] < 2:
        raise ActionError(f"the agent returned an array of the shape {list(shape)}; {expected}")
    finite = np.isfinite(values).all(axis=1)
    if not finite.all():
        raise ActionError("the agent returned a Q-value that is not finite", int(finite.argmin()))
    return values


def call_agent(function: Callable[..., Any], *values: Any, **options: Any) -> Any:
    """Returns what the user's function returns; its exception becomes an ActionError."""
    try:
        return function(*values, **options)
    except UserError:
        raise
    except Exception as error:
        frame = extract_tb(error.__traceback__)[-1]
        place = f"{Path(frame.filename).name}, line {frame.lineno}"
        raise ActionError(f"the agent raised {type(error).__name__}: {error} ({place})") from error


def as_array(value: Any, expected: str) -> NDArray[Any]:
    """Returns a value of NumPy, PyTorch, TensorFlow, JAX or Python as an array of real numbers.

    Raises ActionError, with `expected`, for anything else.
    """
    try:
        if is_torch_tensor(value):
            value = value.detach().cpu()
            value = value.float() if value.is_floating_point() and value.itemsize < 4 else value
        array = np.asarray(value)
    except (TypeError, ValueError, RuntimeError, AttributeError) as error:
        raise ActionError(f"the agent returned a {name_of(type(value))}; {expected}") from error
    if array.dtype.kind not in "fiu":
        kind = f"a {name_of(type(value))} of the type {array.dtype}"
        raise ActionError(f"the agent returned {kind}; {expected}")
    return array


def is_torch_tensor(value: object) -> bool:
    """Returns whether the value is a tensor of PyTorch, which is not imported for it."""
    torch = sys.modules.get("torch")
    return torch is not None and isinstance(value, torch.Tensor)


def name_of(value: object) -> str:
    """Returns a function's own name, else the name of the object's class."""
    name = getattr(value, "__name__", None)
    return name if isinstance(name, str) else type(value).__name__
