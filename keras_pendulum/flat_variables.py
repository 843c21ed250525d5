"""Many TensorFlow variables as one array for each of their types.

A run saves its state between two episodes, and there a call for each variable takes longer than
what it reads (benchmarks/saving.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import keras
import numpy as np
import tensorflow as tf
from numpy.typing import NDArray


class FlatVariables:
    """Reads and writes variables of any shapes, one after the other, by type."""

    def __init__(self, variables: Sequence[keras.Variable]) -> None:
        types = dict.fromkeys(variable.value.dtype.name for variable in variables)
        self._by_type = {
            name: [each for each in variables if each.value.dtype.name == name] for name in types
        }

    def read(self) -> dict[str, NDArray[Any]]:
        """Copies of their numbers: an array [N] for each type, by its name."""
        return {name: numbers.numpy() for name, numbers in self._join().items()}

    @cached_property
    def _join(self) -> Any:
        def join() -> dict[str, tf.Tensor]:
            return {
                name: tf.concat([tf.reshape(each.value, [-1]) for each in variables], 0)
                for name, variables in self._by_type.items()
            }

        return tf.function(join, autograph=False).get_concrete_function()

    def write(self, arrays: dict[str, NDArray[Any]]) -> None:
        """Sets them to arrays of `read`. Raises ValueError when those do not fit."""
        sizes = {
            name: [int(np.prod(each.shape)) for each in variables]
            for name, variables in self._by_type.items()
        }
        wanted = {name: (sum(counts),) for name, counts in sizes.items()}
        found = {name: array.shape for name, array in arrays.items()}
        if found != wanted:
            raise ValueError(f"has numbers {found} for variables {wanted}")
        for name, variables in self._by_type.items():
            parts = np.split(arrays[name], np.cumsum(sizes[name])[:-1])
            for variable, part in zip(variables, parts, strict=True):
                variable.assign(part.reshape(variable.shape))
