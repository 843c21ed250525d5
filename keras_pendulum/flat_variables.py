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


class FlatVariables:
    """Reads and writes groups of variables of any shapes, one after the other, by type."""

    def __init__(self, **groups: Sequence[keras.Variable]) -> None:
        self._groups = groups

    def read(self) -> dict[str, Arrays]:
        """The numbers of each group as they are now, not to be changed."""
        # The new tensors' own memory; `numpy()` would copy it once more.
        return {
            group: {name: np.asarray(memoryview(numbers)) for name, numbers in tensors.items()}
            for group, tensors in self._join().items()
        }

    @cached_property
    def _join(self) -> Any:
        def join() -> dict[str, dict[str, tf.Tensor]]:
            joined: dict[str, dict[str, tf.Tensor]] = {}
            for group, variables in self._groups.items():
                parts: dict[str, list[tf.Tensor]] = {}
                for variable in variables:
                    part = tf.reshape(variable.value, [-1])
                    parts.setdefault(_type(variable), []).append(part)
                joined[group] = {name: tf.concat(each, 0) for name, each in parts.items()}
            return joined

        return tf.function(join, autograph=False).get_concrete_function()

    def split(self, group: str, arrays: Arrays) -> list[NDArray[Any]]:
        """What each variable of a group has in arrays of `read`, in its shape.

        Raises ValueError when the arrays do not fit the group.
        """
        wanted: dict[str, tuple[int, ...]] = {}
        places = []
        for variable in self._groups[group]:
            name, shape = _type(variable), tuple(variable.shape)
            (start,) = wanted.get(name, (0,))
            end = start + math.prod(shape)
            wanted[name] = (end,)
            places.append((name, start, end, shape))
        found = {name: array.shape for name, array in arrays.items()}
        if found != wanted:
            raise ValueError(f"has numbers {found} for variables {wanted}")
        return [arrays[name][start:end].reshape(shape) for name, start, end, shape in places]

    def write(self, group: str, arrays: Arrays) -> None:
        """Sets a group to arrays of `read`. Raises ValueError when those do not fit."""
        for variable, part in zip(self._groups[group], self.split(group, arrays), strict=True):
            variable.assign(part)


def _type(variable: keras.Variable) -> str:
    name: str = variable.value.dtype.name
    return name
