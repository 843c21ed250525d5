"""The order in which a network calls the layers of a file that holds weights alone."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import NamedTuple

from keras_pendulum.errors import WeightsError

_MOST_UNORDERED = 8  # layers; all their orders are tried


class StoredLayer(NamedTuple):
    """A layer as a file stores it."""

    name: str
    group: str
    arrays: dict[str, tuple[int, ...]]  # shapes of the kernel [in, out] and the bias, by path
    container: str | None  # layers of one container are called in the order of their numbers
    number: int


def call_order(layers: list[StoredLayer], input_size: int, path: str) -> list[StoredLayer]:
    """Returns the layers in the only order that their containers and shapes allow.

    Returns them as they are when no order fits.

    Args:
        layers: the layers.
        input_size: inputs of the first layer.
        path: the file, for messages.

    Raises WeightsError when more than one order fits.
    """
    containers = {layer.container for layer in layers}
    if len(containers) == 1 and None not in containers:
        return sorted(layers, key=lambda layer: layer.number)
    if len(layers) <= _MOST_UNORDERED:
        orders = [
            order
            for order in itertools.permutations(layers)
            if _fits(order, input_size) and _respects_containers(order)
        ]
        if len(orders) <= 1:
            return list(*orders) or layers
    raise WeightsError(
        f"{path}: does not record the order of its layers {[layer.name for layer in layers]}, and "
        "their shapes allow more than one: save the whole model, or a Sequential or functional one"
    )


def _fits(order: Sequence[StoredLayer], input_size: int) -> bool:
    """Returns whether each layer has as many inputs as the previous one has outputs."""
    shapes = [(input_size,), *(next(iter(layer.arrays.values())) for layer in order)]
    return all(a[-1:] == b[:1] for a, b in itertools.pairwise(shapes))


def _respects_containers(order: Sequence[StoredLayer]) -> bool:
    """Returns whether the layers of each container are in the order of their numbers."""
    numbers: dict[str, list[int]] = {}
    for layer in order:
        if layer.container is not None:
            numbers.setdefault(layer.container, []).append(layer.number)
    return all(each == sorted(each) for each in numbers.values())
