"""The order of layers that a file does not record."""

from __future__ import annotations

import pytest

import keras_pendulum as kp
from keras_pendulum.storage.layer_order import StoredLayer, call_order


def layer(
    name: str, inputs: int, outputs: int, container: str | None = None, number: int = 0
) -> StoredLayer:
    shapes = {f"{name}/kernel": (inputs, outputs), f"{name}/bias": (outputs,)}
    return StoredLayer(name, name, shapes, container, number)


def names(layers: list[StoredLayer]) -> str:
    return "".join(each.name for each in call_order(layers, 3, "a.h5"))


def test_layers_without_recorded_order_are_ordered_by_their_shapes() -> None:
    layers = [layer("b", 8, 4), layer("c", 4, 2), layer("a", 3, 8)]
    assert names(layers) == "abc"


def test_only_order_that_uses_all_layers_counts() -> None:
    """Two layers take 3 inputs; only one order reaches the end with all of them."""
    assert names([layer("c", 3, 2), layer("b", 8, 3), layer("a", 3, 8)]) == "abc"


def test_layers_of_one_container_follow_their_numbers_not_their_place() -> None:
    layers = [layer("b", 8, 8, "x", 10), layer("a", 3, 8, "x", 2), layer("c", 8, 2, "x", 11)]
    assert names(layers) == "abc"


def test_numbers_of_a_container_order_equal_shapes() -> None:
    hidden = [layer("c", 8, 8, "x", 2), layer("b", 8, 8, "x", 1), layer("a", 3, 8, "x", 0)]
    assert names([layer("d", 8, 2), *hidden]) == "abcd"


def test_two_possible_orders_are_refused() -> None:
    layers = [layer("a", 3, 8), layer("b", 8, 8), layer("c", 8, 8), layer("d", 8, 2)]
    with pytest.raises(kp.WeightsError, match=r"^a\.h5: does not record the order of its layers"):
        names(layers)


def test_layers_that_never_fit_are_returned_as_they_are() -> None:
    assert names([layer("b", 5, 2), layer("a", 3, 8)]) == "ba"


def test_eight_layers_are_ordered_and_nine_are_refused() -> None:
    layers = [layer(str(i), 3 + i, 4 + i) for i in range(9)]
    assert names(layers[7::-1]) == "01234567"
    with pytest.raises(kp.WeightsError, match="does not record the order"):
        names(layers)
