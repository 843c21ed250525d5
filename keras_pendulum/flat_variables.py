"""Many TensorFlow variables as one array for each of their types.

A run saves its state between two episodes, and there a call for each variable takes longer than
what it reads (benchmarks/saving.py).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import Any

import keras
import numpy as np
import tensorflow as tf
from numpy.typing import NDArray

Arrays = dict[str, NDArray[Any]]  # [N] for each type, by its name
_Shapes = dict[str, tuple[int]]
_Place = tuple[str, int, int, tuple[int, ...]]  # type, start, end, shape


class FlatVariables:
    """Reads and writes groups of variables of any shapes, one after the other, by type."""

    def __init__(self, **groups: Sequence[keras.Variable]) -> None:
        self._groups = groups

    def read(self) -> dict[str, Arrays]:
        """The numbers of each group as they are now, not to be changed."""
        return {group: numbers(tensors) for group, tensors in self._read().items()}

    @cached_property
    def _read(self) -> Any:
        def read() -> dict[str, dict[str, tf.Tensor]]:
            return {group: self.joined(group) for group in self._groups}

        return tf.function(read, autograph=False).get_concrete_function()

    def joined(self, group: str) -> dict[str, tf.Tensor]:
        """The numbers of a group as tensors [N]; for use inside a compiled function."""
        parts: dict[str, list[tf.Tensor]] = {}
        for variable in self._groups[group]:
            parts.setdefault(_type(variable), []).append(tf.reshape(variable.value, [-1]))
        return {name: tf.concat(each, 0) for name, each in parts.items()}

    def split(self, group: str, arrays: Arrays) -> list[NDArray[Any]]:
        """What each variable of a group has in arrays of `read`, in its shape.

        Raises ValueError when the arrays do not fit the group.
        """
        wanted, places = self._places[group]
        found = {name: array.shape for name, array in arrays.items()}
        if found != wanted:
            raise ValueError(f"has numbers {found} for variables {wanted}")
        return [arrays[name][start:end].reshape(shape) for name, start, end, shape in places]

    @cached_property
    def _places(self) -> dict[str, tuple[_Shapes, list[_Place]]]:
        """The shapes of each group's arrays, and where in them each of its variables is."""
        found = {}
        for group, variables in self._groups.items():
            ends: dict[str, int] = {}
            places = []
            for variable in variables:
                name, shape = _type(variable), tuple(variable.shape)
                start = ends.get(name, 0)
                ends[name] = start + math.prod(shape)
                places.append((name, start, ends[name], shape))
            found[group] = ({name: (end,) for name, end in ends.items()}, places)
        return found

    def write(self, group: str, arrays: Arrays) -> None:
        """Sets a group to arrays of `read`. Raises ValueError when those do not fit."""
        for variable, part in zip(self._groups[group], self.split(group, arrays), strict=True):
            variable.assign(part)


def numbers(tensors: dict[str, tf.Tensor]) -> Arrays:
    """Tensors that `joined` gave as arrays, not to be changed."""
    # The tensors' own memory; `numpy()` would copy it once more.
    return {name: np.asarray(memoryview(tensor)) for name, tensor in tensors.items()}


def _type(variable: keras.Variable) -> str:
    name: str = variable.value.dtype.name
    return name
