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


@pytest.mark.parametrize(
    ("layers", "order"),
    [
        ([layer("b", 8, 4), layer("c", 4, 2), layer("a", 3, 8)], "abc"),
        # Two layers take 3 inputs; only one order reaches the end with all of them.
        ([layer("c", 3, 2), layer("b", 8, 3), layer("a", 3, 8)], "abc"),
        # The numbers of a container count, not the places.
        ([layer("b", 8, 8, "x", 10), layer("a", 3, 8, "x", 2), layer("c", 8, 2, "x", 11)], "abc"),
        (
            [
                *(layer("d", 8, 2), layer("c", 8, 8, "x", 2)),
                *(layer("b", 8, 8, "x", 1), layer("a", 3, 8, "x", 0)),
            ],
            "abcd",
        ),
        # They never fit, so they stay as they are.
        ([layer("b", 5, 2), layer("a", 3, 8)], "ba"),
    ],
)
def test_only_order_that_shapes_and_containers_allow_is_returned(
    layers: list[StoredLayer], order: str
) -> None:
    assert names(layers) == order


def test_two_possible_orders_are_refused() -> None:
    layers = [layer("a", 3, 8), layer("b", 8, 8), layer("c", 8, 8), layer("d", 8, 2)]
    with pytest.raises(kp.WeightsError, match=r"^a\.h5: does not record the order of its layers"):
        names(layers)


def test_eight_layers_are_ordered_and_nine_are_refused() -> None:
    layers = [layer(str(i), 3 + i, 4 + i) for i in range(9)]
    assert names(layers[7::-1]) == "01234567"
    with pytest.raises(kp.WeightsError, match="does not record the order"):
        names(layers)
