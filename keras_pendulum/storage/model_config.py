"""The layers that Keras records of a whole model, as JSON, in `.h5` and `.keras` files.

Only a chain of Dense layers makes the same network here; any other layer is refused by its name.
"""

from __future__ import annotations

import json
from typing import Any, NamedTuple, NoReturn

from keras_pendulum.dqn.policy import ACTIVATIONS
from keras_pendulum.errors import UnknownLayersError, WeightsError

_KINDS = ("InputLayer", "Flatten", "Dense", "Activation", "ReLU", "Dropout")
_EXPECTED = "expected a chain of Dense layers (with Activation, ReLU and Dropout layers)"


class DenseLayer(NamedTuple):
    """A Dense layer of a model."""

    name: str
    number: int  # among the model's Dense layers, in the order in which the model lists them
    activation: str  # also that of an Activation layer behind it


def read_model(text: Any, path: str) -> dict[str, Any]:
    """Returns the JSON of a model. Raises WeightsError when it is not JSON."""
    try:
        model = json.loads(text)
    except (TypeError, ValueError, RecursionError) as error:
        raise WeightsError(f"{path}: its model_config is not JSON") from error
    if not isinstance(model, dict):
        raise WeightsError(f"{path}: its model_config is not a JSON object")
    return model


def dense_layers(model: dict[str, Any], path: str) -> list[DenseLayer] | None:
    """Returns the Dense layers of a model in the order of their calls.

    Returns None for a subclassed model: its layers are in its own code.

    Raises WeightsError, with the name of the layer, when the model is not a chain of Dense layers.
    """
    kind, config = model["class_name"], model["config"]
    if kind not in ("Sequential", "Functional", "Model"):
        if "layers" in config:
            raise UnknownLayersError(
                f"{path}: the model is a {kind}, which may call its layers otherwise"
            )
        return None
    # Before Keras 2.2.3, the configuration is the list of layers.
    layers = config if isinstance(config, list) else config["layers"]
    numbers: dict[str, int] = {}
    for layer in layers:
        _check(layer, path)
        if layer["class_name"] == "Dense":
            numbers[layer["config"]["name"]] = len(numbers)
    chain: list[DenseLayer] = []
    last_activated = ""
    for layer in layers if kind == "Sequential" else _in_call_order(config, path):
        name, activation = layer["config"]["name"], layer["config"].get("activation")
        if layer["class_name"] == "ReLU":
            activation = "relu"
        if activation not in (None, "linear"):
            last_activated = name
        if layer["class_name"] == "Dense":
            chain.append(DenseLayer(name, numbers[name], activation))
        elif layer["class_name"] in ("Activation", "ReLU") and activation != "linear":
            if not chain or chain[-1].activation != "linear":
                _refuse(path, name, f"applies {activation} to what is no output of a linear layer")
            chain[-1] = chain[-1]._replace(activation=activation)
    if not chain:
        raise UnknownLayersError(f"{path}: the model has no Dense layer; {_EXPECTED}")
    if chain[-1].activation != "linear":
        _refuse(path, last_activated, f"applies {chain[-1].activation} to the Q-values")
    return chain


def _check(layer: dict[str, Any], path: str) -> None:
    """Raises WeightsError for a layer that a chain of Dense layers cannot have."""
    kind, config = layer["class_name"], layer["config"]
    name = config["name"]
    registered_name = layer.get("registered_name")
    if registered_name or kind not in _KINDS:
        _refuse(path, name, f"is a {registered_name or kind}")
    shape = config.get("batch_shape", config.get("batch_input_shape"))
    if shape is not None and len(shape) != 2 and (len(shape) != 3 or shape[1] != 1):
        _refuse(path, name, f"takes inputs of the shape {shape}")
    dtype = config.get("dtype") or "float32"
    if isinstance(dtype, dict):
        dtype = dtype["config"]["name"]
    if dtype not in ("float32", "float64"):
        _refuse(path, name, f"computes in {dtype}")
    activation = config.get("activation", "linear")
    if isinstance(activation, dict):  # a layer, or a function of the user
        activation = activation.get("class_name", "a function")
    if activation not in ACTIVATIONS:
        _refuse(path, name, f"has the activation {activation}, not {', '.join(ACTIVATIONS)}")
    bends = [config.get(each) for each in ("max_value", "negative_slope", "threshold")]
    if kind == "ReLU" and (bends[0] is not None or any(bends)):
        _refuse(path, name, "is another function than max(x, 0)")
    if kind == "Dense" and not config["use_bias"]:
        _refuse(path, name, "has no bias")


def _in_call_order(config: dict[str, Any], path: str) -> list[dict[str, Any]]:
    """Returns the layers of a functional model from its input to its output."""
    layers = {layer["config"]["name"]: layer for layer in config["layers"]}
    following: dict[str, str] = {}
    for name, layer in layers.items():
        if layer["class_name"] == "InputLayer":
            continue
        nodes = layer["inbound_nodes"]
        source = _only_source(nodes[0]) if len(nodes) == 1 else None
        if source is None:
            _refuse(path, name, "does not take its input from the layer before it alone")
        following[source] = name
    chain = _names(config["input_layers"])
    if len(chain) > 1:
        _refuse(path, chain[1], "is a second input")
    while chain[-1] in following and len(chain) <= len(layers):  # no more than once around a circle
        chain.append(following[chain[-1]])
    if apart := layers.keys() - chain:
        _refuse(path, min(apart), "is not on the way from the input to the output")
    if _names(config["output_layers"]) != chain[-1:]:
        _refuse(path, chain[-1], "is not the only output")
    return [layers[name] for name in chain]


def _only_source(node: Any) -> str | None:
    """Returns the name of the layer whose output is a call's only argument, else None."""
    if isinstance(node, dict):  # Keras 3
        tensors = [each.get("config", {}) for each in node["args"] if isinstance(each, dict)]
        sources = [tensor.get("keras_history") for tensor in tensors]
        arguments = node["kwargs"]
        count = len(node["args"])
    else:  # Keras 2: layer, call, output and further arguments
        sources = [each[:3] for each in node]
        arguments = node[0][3] if len(node[0]) > 3 else {}
        count = len(node)
    if count != 1 or sources[0] is None or sources[0][1:] != [0, 0] or any(arguments.values()):
        return None
    return str(sources[0][0])


def _names(tensors: Any) -> list[str]:
    """Returns the layers of a model's inputs or outputs, which Keras stores in three ways."""
    if isinstance(tensors, dict):
        tensors = list(tensors.values())
    if isinstance(tensors[0], str):
        tensors = [tensors]
    return [str(tensor[0]) for tensor in tensors]


def _refuse(path: str, name: str, found: str) -> NoReturn:
    raise UnknownLayersError(f"{path}: layer {name} {found}; {_EXPECTED}")
