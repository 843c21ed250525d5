"""Keras's configuration of a model. `test_files_of_keras.py` reads files of both versions."""

from __future__ import annotations

import json
from typing import Any

import pytest

import keras_pendulum as kp
from keras_pendulum.storage.model_config import dense_layers, read_model


def layer(kind: str, name: str, **config: Any) -> dict[str, Any]:
    settings = {"name": name, **config}
    if kind == "Dense":
        settings = {"activation": "linear", "use_bias": True, **settings}
    return {"class_name": kind, "config": settings}


def sequential(*layers: dict[str, Any]) -> dict[str, Any]:
    return {"class_name": "Sequential", "config": {"layers": list(layers)}}


def found(model: dict[str, Any]) -> list[tuple[Any, ...]] | None:
    layers = dense_layers(model, "a.h5")
    return None if layers is None else [tuple(each) for each in layers]


def test_activation_layers_belong_to_the_dense_layer_before_them() -> None:
    model = sequential(
        layer("Dense", "a"),
        layer("Dropout", "x"),
        layer("Activation", "y", activation="tanh"),
        layer("Dense", "b", activation="relu"),
        layer("Activation", "z", activation="linear"),
        layer("Dense", "c"),
    )
    assert found(model) == [("a", 0, "tanh"), ("b", 1, "relu"), ("c", 2, "linear")]


def test_layers_of_the_oldest_files_are_the_configuration() -> None:
    model = {"class_name": "Sequential", "config": [layer("Dense", "a")]}
    assert found(model) == [("a", 0, "linear")]


def test_subclassed_model_records_no_layers() -> None:
    assert found({"class_name": "MyModel", "config": {"name": "m"}}) is None


@pytest.mark.parametrize(
    ("layers", "message"),
    [
        ([], "has no Dense layer"),
        ([layer("Dense", "odd", activation="relu")], "layer odd applies relu to the Q-values"),
        ([layer("Dense", "odd", use_bias=False)], "layer odd has no bias"),
        ([layer("Dense", "odd", activation="elu")], "layer odd has the activation elu"),
        ([layer("Dense", "odd", activation={"class_name": "ReLU"})], "activation ReLU"),
        ([layer("Dense", "odd", dtype="float16")], "layer odd computes in float16"),
        ([layer("Activation", "odd", activation="tanh")], "layer odd applies tanh to what"),
        ([layer("InputLayer", "odd", batch_shape=[None, 4, 3])], "layer odd takes inputs of"),
        (
            [layer("Dense", "a", activation="tanh"), layer("Activation", "odd", activation="relu")],
            "layer odd applies relu to what",
        ),
        ([{**layer("Dense", "odd"), "registered_name": "My>Dense"}], "layer odd is a My>Dense"),
    ],
)
def test_other_layers_are_refused_by_name(layers: list[dict[str, Any]], message: str) -> None:
    with pytest.raises(kp.WeightsError, match=rf"^a\.h5: .*{message}"):
        found(sequential(*layers))


def functional(names: str, sources: dict[str, list[str]]) -> dict[str, Any]:
    """Returns a functional model; `sources` has the layers of each call's arguments."""
    layers = []
    for name in names:
        made = layer("InputLayer" if name == "i" else "Dense", name)
        arguments = [[source, 0, 0, {}] for source in sources.get(name, [])]
        layers.append({**made, "inbound_nodes": [arguments] if arguments else []})
    config = {"layers": layers, "input_layers": [["i", 0, 0]], "output_layers": [["c", 0, 0]]}
    return {"class_name": "Functional", "config": config}


@pytest.mark.parametrize(
    ("names", "sources"),
    [
        ("iabc", {"a": ["i"], "b": ["a"], "c": ["a"]}),  # two ways
        ("iabc", {"a": ["i"], "b": ["a"], "c": ["a", "b"]}),  # two arguments
        ("iabc", {"a": ["i"], "c": ["a"], "b": ["b"]}),  # a layer behind itself
        ("iabc", {"a": ["c"], "b": ["a"], "c": ["b"]}),  # a circle
        ("iabcd", {"a": ["i"], "b": ["a"], "c": ["b"], "d": ["c"]}),  # an inner output
    ],
)
def test_functional_model_that_is_no_chain_is_refused(
    names: str, sources: dict[str, list[str]]
) -> None:
    with pytest.raises(kp.WeightsError, match=r"^a\.h5: layer [abcd] "):
        found(functional(names, sources))


@pytest.mark.parametrize("text", ["", "[", "[]", "1", None, "[" * 100_000])
def test_configuration_that_is_no_json_object_is_refused(text: Any) -> None:
    with pytest.raises(kp.WeightsError, match=r"^a\.h5: its model_config is not"):
        read_model(text, "a.h5")
    assert read_model(json.dumps({"a": 1}), "a.h5") == {"a": 1}
