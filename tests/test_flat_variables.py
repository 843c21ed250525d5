"""Variables as flat arrays: what is read is what was there, and it goes back where it was."""

from __future__ import annotations

import keras
import numpy as np
import pytest

from keras_pendulum.flat_variables import FlatVariables


def variables() -> list[keras.Variable]:
    return [
        keras.Variable(np.array([[1.0, 2.0], [3.0, 4.0]]), dtype="float32"),
        keras.Variable(7, dtype="int64"),
        keras.Variable(np.array([5.0]), dtype="float32"),
        keras.Variable(np.array(6.0), dtype="float32"),
    ]


def test_they_are_read_one_after_the_other_by_type() -> None:
    arrays = FlatVariables(some=variables()).read()["some"]
    assert {name: (array.dtype.name, array.tolist()) for name, array in arrays.items()} == {
        "float32": ("float32", [1, 2, 3, 4, 5, 6]),
        "int64": ("int64", [7]),
    }


def test_what_was_read_is_a_copy_and_can_be_written_back() -> None:
    ours = variables()
    flat = FlatVariables(ours=ours, theirs=variables())
    before = flat.read()["ours"]
    ours[0].assign([[9.0, 9.0], [9.0, 9.0]])
    ours[1].assign(8)
    assert flat.read()["ours"]["float32"].tolist() == [9, 9, 9, 9, 5, 6]
    assert flat.read()["theirs"]["float32"].tolist() == [1, 2, 3, 4, 5, 6]
    assert before["float32"].tolist() == [1, 2, 3, 4, 5, 6]
    flat.write("ours", before)
    assert ours[0].numpy().tolist() == [[1, 2], [3, 4]]
    assert [int(ours[1]), ours[2].numpy().tolist(), float(ours[3])] == [7, [5], 6]


def test_arrays_are_split_into_the_shapes_and_the_order_of_the_variables() -> None:
    flat = FlatVariables(some=variables())
    parts = flat.split("some", flat.read()["some"])
    assert [part.tolist() for part in parts] == [[[1, 2], [3, 4]], 7, [5], 6]


@pytest.mark.parametrize(
    "arrays",
    [
        {"float32": np.zeros(6, np.float32)},
        {"float32": np.zeros(5, np.float32), "int64": np.zeros(1, np.int64)},
        {"float32": np.zeros((6, 1), np.float32), "int64": np.zeros(1, np.int64)},
        {"float32": np.zeros(6, np.float32), "int64": np.zeros(1, np.int64), "bool": np.zeros(0)},
    ],
)
def test_what_does_not_fit_changes_nothing(arrays: dict[str, np.ndarray]) -> None:
    flat = FlatVariables(some=variables())
    with pytest.raises(ValueError, match="for variables"):
        flat.write("some", arrays)
    assert flat.read()["some"]["float32"].tolist() == [1, 2, 3, 4, 5, 6]
