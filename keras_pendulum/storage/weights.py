"""Saves and loads networks as `.h5` files in the layout of Keras 2, which Keras 3 loads too.

`keras_h5` checks a file before a network is made from it. No loader of Keras reads the file.
"""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Iterable
from importlib import resources
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from keras_pendulum.config.config import validate_setting
from keras_pendulum.dqn.network import DQN, Provenance
from keras_pendulum.dqn.policy import ACTIVATIONS
from keras_pendulum.environments.tasks import TASKS
from keras_pendulum.errors import ConfigError, UserError, WeightsError
from keras_pendulum.storage import keras_h5
from keras_pendulum.storage.checksum import write_with_checksum
from keras_pendulum.storage.hdf5_writer import (
    add_arrays,
    add_attributes,
    add_group,
    file_bytes,
    file_in_memory,
)
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
    content = encode_weights(network, network.get_weights(), evaluated_return=evaluated_return)

    def read_back(file: Path) -> None:
        try:
            _read(file)
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
    attributes = {
        name: value.encode() if isinstance(value, str) else value
        for name, value in values.items()
        if value is not None
    }
    with file_in_memory() as file:
        keras_h5.write_layers(file, weights)
        add_attributes(add_group(file, _GROUP), attributes)
        for name, arrays in groups.items():
            add_arrays(add_group(file, name), arrays)
        return file_bytes(file)


def require_finite(arrays: Iterable[NDArray[Any]]) -> None:
    """Raises UserError when a number is NaN or infinite, which `load_weights` rejects."""
    if not all(np.isfinite(array).all() for array in arrays):
        raise UserError(
            "a weight is not finite, learning has diverged; nothing is saved: try a smaller "
            "learning_rate"
        )


def load_weights(path: str | os.PathLike[str]) -> DQN:
    """Returns the network in a `.h5` of this package, of Keras 2, or of Keras 3 (`.weights.h5`).

    The file determines layer sizes and action count. Without a recorded activation, the hidden
    layers use tanh.

    Raises WeightsError when the file is missing or damaged, or does not hold such a network.
    """
    activation, provenance, layers = _read(path)
    widths = [bias.shape[0] for bias in layers[1::2]]
    network = DQN(
        widths[:-1],
        widths[-1],
        observation_size=TASKS[provenance.environment].observation_size,
        activation=activation,
        provenance=provenance,
    )
    network.set_weights(layers)
    return network


def _read(path: str | os.PathLike[str]) -> tuple[str, Provenance, list[NDArray[np.float32]]]:
    """Returns the activation, the provenance and the checked weights of a file's network."""
    with keras_h5.open_h5(path) as file:
        activation, provenance = _read_attributes(file, path)
        task = TASKS[provenance.environment]
        layers = keras_h5.read_layers(file, path, task.observation_size)
    outputs = layers[-1].shape[0]
    if outputs < 2:
        raise WeightsError(f"{path}: the network has one output; expected one for each action")
    if task.action_count not in (None, outputs):
        raise WeightsError(
            f"{path}: the network has {outputs} outputs; {provenance.environment} has "
            f"{task.action_count} actions"
        )
    return activation, provenance, layers


def _read_attributes(file: h5py.File, path: str | os.PathLike[str]) -> tuple[str, Provenance]:
    attributes = {
        name: keras_h5.decode(value) if isinstance(value, bytes | str) else value
        for name, value in (file[_GROUP].attrs.items() if _GROUP in file else ())
    }
    activation = attributes.get("activation", "tanh")
    if activation not in ACTIVATIONS:
        raise WeightsError(
            f"{path}: records the activation {activation!r}; expected {' or '.join(ACTIVATIONS)}"
        )
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
    return activation, Provenance(
        environment=environment,
        gravity=gravity,
        preset=attributes.get("preset"),
        seed=int(attributes["seed"]) if "seed" in attributes else None,
        config=attributes.get("config"),
    )


def _versions() -> dict[str, str]:
    """Returns the versions of Python and of the packages that computed the weights."""
    import gymnasium
    import keras
    import tensorflow as tf

    return {
        "python": platform.python_version(),
        **{module.__name__: module.__version__ for module in (tf, keras, gymnasium, np)},
    }


def find_weights(name: str) -> Path:
    """Returns the path of a weights file: `name` itself, or the shipped file `name`(.h5).

    Raises WeightsError when neither exists.
    """
    path = Path(name)
    try:
        if path.is_file():
            return path
    except OSError as error:  # a name that no file can have
        raise WeightsError(f"{name}: {error.strerror}; expected a weights file (.h5)") from error
    # A wheel holds the shipped weights inside the package, a checkout beside it.
    package = Path(str(resources.files("keras_pendulum")))
    for folder in (package / "shipped_weights", package.parent / "weights"):
        for candidate in (folder / name, folder / f"{name}.h5"):
            if path.name == name and candidate.is_file():
                return candidate
    problem = "not a file" if path.exists() else "no such file"
    raise WeightsError(f"{name}: {problem}; expected a weights file (.h5)")
