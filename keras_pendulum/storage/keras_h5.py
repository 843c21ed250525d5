"""Reads the layers of a feed-forward network in an HDF5 file of Keras.

Keras loads some wrong files in part, and others without an error. Here layers are returned only
when the file records their order or their sizes determine it, when they are finite floating-point
numbers, and when each layer has as many inputs as the previous one has outputs.
"""

from __future__ import annotations

import os
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.dqn.network import REGISTERED_NAME
from keras_pendulum.errors import UnknownLayersError, WeightsError
from keras_pendulum.limits import LARGEST_WEIGHT
from keras_pendulum.storage.layer_order import StoredLayer, call_order
from keras_pendulum.storage.model_config import dense_layers
from keras_pendulum.storage.quarantine import H5File

_LARGEST_LAYER = 8192  # units
# Kinds of layers without weights that keep the network a chain of Dense layers.
_WITHOUT_WEIGHTS = {
    *("input", "input_layer", "flatten", "dropout", "activation"),
    "dense",  # without weights, it was never called
    *("sequential", "functional"),  # models inside the model
}
_NOT_LAYERS = {"optimizer", "metrics", "seed_generator"}


class Layer(NamedTuple):
    """A Dense layer."""

    name: str
    kernel: NDArray[np.float32]  # [in, out]
    bias: NDArray[np.float32]  # [out]
    activation: str | None  # None where the file does not record it


def read_layers(file: H5File, input_size: int, model: dict[str, Any] | None) -> list[Layer]:
    """Returns the layers in the order of their calls; the first has `input_size` inputs.

    Args:
        file: the open file.
        input_size: D, the size of an observation.
        model: the recorded configuration of a whole model.

    Raises WeightsError when the file holds no layers, other layers than a chain of Dense layers, or
    layers in an order that it does not determine.
    """
    chain = dense_layers(model, file.path) if model else None
    # In a whole model, Keras 2 puts the weights into a group.
    root = "model_weights/" if "model_weights" in file else ""
    if "layer_names" in file.attributes.get(root.rstrip("/"), {}):
        stored = _keras2_layers(file, root, chain is not None)
        keys = [root + layer.name for layer in chain or ()]
    else:
        stored = _keras3_layers(file, chain is not None)
        keys = [f"layers/dense_{layer.number}".removesuffix("_0") for layer in chain or ()]
    if not stored:
        raise WeightsError(
            f"{file.path}: holds no network weights in a layout of Keras 2 or Keras 3"
        )
    if chain:
        by_group = {each.group: each for each in stored}
        for key in keys:
            if key not in by_group:
                raise WeightsError(f"{file.path}: has no weights of layer {key}")
        ordered = [by_group[key] for key in keys]
    elif model and model.get("registered_name") == REGISTERED_NAME:
        # The hidden layers are in a list, and the head is not.
        ordered = sorted(stored, key=lambda each: (each.container is None, each.number))
    else:
        ordered = call_order(stored, input_size, file.path)
    activations = [layer.activation for layer in chain] if chain else [None] * len(ordered)
    layers: list[Layer] = []
    for each, activation in zip(ordered, activations, strict=True):
        layers.append(_read_layer(file, each, activation))
        _, kernel, bias, _ = layers[-1]
        if kernel.shape[0] != input_size:
            previous = "the previous layer" if layers[1:] else "an observation"
            raise WeightsError(
                f"{file.path}: layer {each.name} has {kernel.shape[0]} inputs; expected "
                f"{input_size}, the size of {previous}"
            )
        input_size = bias.shape[0]
    return layers


def _read_layer(file: H5File, stored: StoredLayer, activation: str | None) -> Layer:
    """Returns a layer. Raises WeightsError when it is not a Dense layer of finite numbers."""
    layer = f"{file.path}: layer {stored.name}"
    if len(stored.arrays) != 2:
        raise WeightsError(f"{layer} has {len(stored.arrays)} arrays; expected kernel and bias")
    kernel, bias = map(file.read, stored.arrays)
    if kernel.dtype.kind != "f" or bias.dtype.kind != "f":
        raise WeightsError(f"{layer} has the type {kernel.dtype}; expected floating-point")
    if kernel.ndim != 2 or bias.shape != kernel.shape[1:]:
        raise WeightsError(
            f"{layer} has shapes {kernel.shape} and {bias.shape}; expected a kernel [in, out] and "
            "a bias [out]"
        )
    if not 1 <= kernel.shape[1] <= _LARGEST_LAYER:
        raise WeightsError(f"{layer} has {kernel.shape[1]} units; expected 1 to {_LARGEST_LAYER}")
    for array in (kernel, bias):
        require_sane(array, f"layer {stored.name}", file.path)
    return Layer(stored.name, kernel.astype(np.float32), bias.astype(np.float32), activation)


def require_sane(array: NDArray[Any], name: str, path: str | os.PathLike[str]) -> None:
    """Raises WeightsError for a weight so large that the network's outputs could overflow."""
    largest = np.abs(array).max(initial=0)
    if largest > LARGEST_WEIGHT:
        raise WeightsError(
            f"{os.fsdecode(path)}: {name} has a weight of the size {largest:.3g}; expected at most "
            f"{LARGEST_WEIGHT:g}: learning has diverged, or the file is damaged"
        )


def _keras2_layers(file: H5File, root: str, is_chain: bool) -> list[StoredLayer]:
    """Returns the layers with weights, in the order that the file records.

    `is_chain` says whether the recorded configuration has shown what the others do.
    """
    names = _texts(file, root.rstrip("/"), "layer_names")
    layers = []
    for number, name in enumerate(names):
        weights = _texts(file, root + name, "weight_names")
        if names.index(name) != number:
            raise WeightsError(f"{file.path}: has two layers of the name {name}")
        if not weights:
            if not is_chain:
                _require_no_effect(file.path, name, name)
            continue
        # The names of a subclassed model begin with its own. Its layers are in the order in which
        # its attributes were assigned.
        container = "" if weights == [f"{name}/kernel:0", f"{name}/bias:0"] else None
        arrays = {key: file.shapes.get(key, ()) for key in (f"{root}{name}/{w}" for w in weights)}
        layers.append(StoredLayer(name, root + name, arrays, container, number))
    return layers


def _keras3_layers(file: H5File, is_chain: bool) -> list[StoredLayer]:
    """Returns the layers with weights. Their paths name the attributes that hold them."""
    layers = []
    for group, attributes in file.attributes.items():
        *parents, last = group.split("/")
        # A Dropout may have a seed_generator.
        if last != "vars" or not parents or {*parents[:1], *parents[-1:]} & _NOT_LAYERS:
            continue
        prefix = f"{group}/"
        keys = [key for key in file.shapes if key.startswith(prefix)]
        arrays = {key: file.shapes[key] for key in sorted(keys, key=lambda key: _split(key)[1])}
        *containers, key = parents
        container: str | None = "/".join(containers)
        name = attributes.get("name", "/".join(parents))
        # Below `layers` the path names the class of the layer.
        kind = key if containers[-1:] == ["layers"] else name
        if not arrays:
            if not is_chain:
                _require_no_effect(file.path, name, kind)
            continue
        if containers[-1:] == ["layers"] and _split(kind)[0] != "dense":
            raise UnknownLayersError(
                f"{file.path}: layer {name} is a {kind}; expected Dense layers"
            )
        stem, number = _split(key)
        if stem != "dense" or not _is_ordered(file, containers):
            container = None
        layers.append(StoredLayer(name, "/".join(parents), arrays, container, number))
    return layers


def _is_ordered(file: H5File, containers: list[str]) -> bool:
    """Returns whether the layers of a container are called in the order of their numbers.

    They are in a list, and in Sequential and functional models. Those of a subclassed model are in
    the order in which its attributes were assigned.
    """
    if containers[-1:] != ["layers"]:
        return "/".join((*containers, "vars")) not in file  # a list has no variables of its own
    owner = containers[:-1]
    recorded = file.attributes.get("/".join((*owner, "vars")), {}).get("name", "")
    kinds = [_split(name)[0] for name in (str(recorded), *owner[-1:])]
    return "/".join((*containers, "input_layer")) in file or "sequential" in kinds


def _require_no_effect(path: str, name: str, kind: str) -> None:
    """Raises WeightsError for a layer without weights that may change the network."""
    if _split(kind)[0] not in _WITHOUT_WEIGHTS:
        raise UnknownLayersError(
            f"{path}: layer {name} has no weights, and the file does not record what it does; "
            "expected Dense layers"
        )


def _texts(file: H5File, group: str, attribute: str) -> list[str]:
    """Returns an attribute that is a list of names."""
    value = file.attributes.get(group, {}).get(attribute)
    if not isinstance(value, list) or not all(isinstance(each, str) for each in value):
        raise WeightsError(f"{file.path}: {group or 'the file'} has no readable {attribute}")
    return value


def _split(name: str) -> tuple[str, int]:
    """Returns a name without the number at its end, and the number: `dense` and 2 of `dense_2`."""
    stem = name.rstrip("0123456789")
    number = name[len(stem) :]
    return (stem.removesuffix("_"), int(number)) if number else (name, 0)
