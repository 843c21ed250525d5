"""Saves and loads networks as `.h5` files in the layout of Keras 2, which Keras 3 loads too.

`keras_h5` checks a file before a network is made from it. No loader of Keras reads the file.
"""

from __future__ import annotations

import json
import math
import os
import platform
import warnings
from collections.abc import Iterable
from pathlib import Path
from typing import Any
from uuid import uuid4

import h5py
import numpy as np
from numpy.typing import NDArray

from keras_pendulum.config.settings import validate_setting
from keras_pendulum.dqn.network import DQN, REGISTERED_NAME, Provenance
from keras_pendulum.dqn.policy import ACTIVATIONS, activations_of
from keras_pendulum.environments.tasks import TASKS
from keras_pendulum.errors import ConfigError, UserError, WeightsError, require_type
from keras_pendulum.storage.checksum import write_with_checksum
from keras_pendulum.storage.find_weights import find_weights
from keras_pendulum.storage.keras_h5 import Layer, read_layers, write_layers
from keras_pendulum.storage.model_config import read_model
from keras_pendulum.storage.quarantine import H5File, open_h5
from keras_pendulum.tensorflow_setup import THREADS
from keras_pendulum.version import __version__

_GROUP = "keras_pendulum"  # a group beside the layers, which Keras ignores
_OPTIONAL = ("gravity", "preset", "seed", "config")  # fields of Provenance that may be None


def save_weights(
    network: DQN, path: str | os.PathLike[str], evaluated_return: float | None = None
) -> None:
    """Writes the network to `path`; an old file is replaced only when the new one is complete.

    Keras 2 and Keras 3 load the file with `model.load_weights`.

    Args:
        network: the network. Its provenance and the versions of the packages become attributes of
            the group `keras_pendulum`.
        path: the file.
        evaluated_return: the mean return of `evaluate_policy(network)`, one more attribute.

    Raises UserError when the file cannot be written, or when `load_weights` would reject it.
    """
    require_type("network", network, DQN)
    require_type("path", path, (str, os.PathLike))
    content = encode_weights(network, network.get_weights(), evaluated_return=evaluated_return)

    def read_back(file: Path) -> None:
        try:
            _read(str(file))
        except WeightsError as error:
            reason = str(error).removeprefix(f"{file}: ")
            raise UserError(f"cannot write {path}: it could not be loaded, {reason}") from error

    write_with_checksum(path, content, check=read_back)


def encode_weights(
    network: DQN,
    weights: list[NDArray[np.float32]],
    *,
    evaluated_return: float | None = None,
    **groups: dict[str, NDArray[Any]],
) -> bytes:
    """Returns the network's `.h5` file without its checksum.

    Args:
        network: the network, for its activation and provenance.
        weights: its weights, as `get_weights` returns them.
        evaluated_return: see `save_weights`.
        groups: further groups of arrays, by name.

    Raises UserError when a weight is not finite.
    """
    require_finite(weights)
    values = {
        "version": __version__,
        "versions": json.dumps(_versions()),
        "activation": network.activation,
        "environment": network.provenance.environment,
        **{name: getattr(network.provenance, name) for name in _OPTIONAL},
        "evaluated_return": evaluated_return,
    }
    # A unique name, because HDF5 does not open two files of one name, not even in memory.
    unique = f"{uuid4().hex}.h5"
    with h5py.File(unique, "w", driver="core", backing_store=False, block_size=2**23) as file:
        write_layers(file, weights)
        attributes = file.create_group(_GROUP).attrs
        for name, value in values.items():
            if value is not None:
                # Strings of fixed length, because HDF5 stores others in a heap.
                attributes[name] = np.bytes_(value.encode()) if isinstance(value, str) else value
        for name, arrays in groups.items():
            group = file.create_group(name)
            for key, array in arrays.items():
                group.create_dataset(key, data=array, track_times=False)  # the same bytes each time
        file.flush()
        content: bytes = file.id.get_file_image()
    return content


def require_finite(arrays: Iterable[NDArray[Any]]) -> None:
    """Raises UserError when a number is NaN or infinite, which `load_weights` rejects."""
    if not all(np.isfinite(array).all() for array in arrays):
        raise UserError(
            "a weight is not finite, learning has diverged; such a network is neither saved nor "
            "evaluated: try a smaller learning_rate"
        )


def load_weights(path: str | os.PathLike[str], activation: str | None = None) -> DQN:
    """Returns the network in a file of this package, of Keras 2 or of Keras 3.

    The file is a `.h5`, a `.weights.h5` or a `.keras`. It determines layer sizes and action count,
    and in a whole model the activations.

    Args:
        path: the file, or the name of a shipped one.
        activation: tanh, relu or linear, of the hidden layers, for a file that holds weights alone.
            Without it, and without a recorded one, they are tanh, with a warning.

    Raises WeightsError when the file is missing or damaged, does not hold such a network, or
    records another activation.
    """
    require_type("path", path, (str, os.PathLike))
    if activation is not None and activation not in ACTIVATIONS:
        raise ConfigError(f"activation is {activation}, expected {', '.join(ACTIVATIONS)}")
    name = os.fspath(find_weights(path))
    recorded, provenance, layers = _read(name)
    if recorded is None:
        if activation is None:
            warnings.warn(
                f"{name} records no activation: its hidden layers get tanh; name another with "
                "activation= (--activation)",
                stacklevel=2,
            )
    elif activation not in (None, recorded):
        raise WeightsError(
            f"{name}: records the activation {recorded}, not {activation}, for "
            f"{provenance.environment}: give it with --activation {recorded}"
        )
    widths = [layer.bias.shape[0] for layer in layers]
    network = DQN(
        widths[:-1],
        widths[-1],
        observation_size=TASKS[provenance.environment].observation_size,
        activation=recorded or activation or "tanh",
        provenance=provenance,
    )
    network.set_weights([array for layer in layers for array in (layer.kernel, layer.bias)])
    return network


def recorded_return(path: str | os.PathLike[str]) -> float | None:
    """Returns the mean return that a weights file records, or None."""
    with open_h5(path) as file:
        value = file.attributes.get(_GROUP, {}).get("evaluated_return")
    return float(value) if isinstance(value, int | float) and math.isfinite(value) else None


def _read(path: str) -> tuple[str | None, Provenance, list[Layer]]:
    """Returns the recorded activation, the provenance and the checked layers of a network."""
    with open_h5(path) as file:
        root = file.attributes[""]
        model = read_model(root["model_config"], path) if "model_config" in root else None
        attributes = file.attributes.get(_GROUP, {})
        if model and model.get("registered_name") == REGISTERED_NAME:
            config = model["config"]
            attributes = {name: config[name] for name in config if config[name] is not None}
        provenance = _provenance(attributes, path)
        task = TASKS[provenance.environment]
        layers = read_layers(file, path, task.observation_size, model)
    activation = attributes.get("activation")
    if layers[-1].activation is not None:  # a whole model records one for each layer
        names = [str(layer.activation) for layer in layers[:-1]]
        activation = ",".join(names if len(set(names)) > 1 else names[:1]) or "tanh"
    if activation is not None:
        names = activations_of(str(activation), len(layers) - 1)
        if len(names) != len(layers) - 1 or set(names) - ACTIVATIONS.keys():
            raise WeightsError(
                f"{path}: records the activation {activation!r}; expected {', '.join(ACTIVATIONS)}"
            )
    outputs = layers[-1].bias.shape[0]
    if outputs < 2:
        raise WeightsError(f"{path}: the network has one output; expected one for each action")
    if task.action_count not in (None, outputs):
        raise WeightsError(
            f"{path}: the network has {outputs} outputs; {provenance.environment} has "
            f"{task.action_count} actions"
        )
    return activation, provenance, layers


def _provenance(attributes: dict[str, Any], path: str) -> Provenance:
    for name, value in attributes.items():
        if value is None:
            raise WeightsError(f"{path}: the attribute {name} is neither text nor a number")
    environment = attributes.get("environment", "Pendulum-v1")
    if environment not in TASKS:
        raise WeightsError(
            f"{path}: records the environment {environment!r}; expected {' or '.join(TASKS)}"
        )
    gravity = attributes.get("gravity")
    if gravity is not None:
        try:
            gravity = validate_setting("gravity", gravity)
        except ConfigError as error:
            raise WeightsError(f"{path}: the recorded {error}") from error
    return Provenance(
        environment=environment,
        gravity=gravity,
        preset=attributes.get("preset"),
        seed=int(attributes["seed"]) if "seed" in attributes else None,
        config=attributes.get("config"),
    )


def changed_versions(file: H5File) -> list[str]:
    """Returns the recorded `_versions` that are not the present ones, such as `keras 3.14.0`."""
    attributes = file.attributes[_GROUP]
    recorded = {"keras_pendulum": attributes["version"], **json.loads(attributes["versions"])}
    present = {"keras_pendulum": __version__, **_versions()}
    return [f"{name} {recorded[name]}" for name in recorded if recorded[name] != present.get(name)]


def _versions() -> dict[str, str]:
    """Returns the versions and the number of threads that the last digits of a run depend on."""
    import gymnasium
    import keras
    import tensorflow as tf

    return {
        "python": platform.python_version(),
        **{module.__name__: module.__version__ for module in (tf, keras, gymnasium, np)},
        THREADS: os.environ.get(THREADS, "0"),  # 0: TensorFlow chooses
    }
