"""Networks to `.h5` and back, in the Keras 2 layout that Keras 2 and Keras 3 both load.

Reading goes through `layer_files`, which checks everything before a network is made; no Keras
loader ever touches the file.
"""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from keras_pendulum import __version__, layer_files
from keras_pendulum.config import checked_setting
from keras_pendulum.environment import TASKS
from keras_pendulum.errors import ConfigError, UserError, WeightsError
from keras_pendulum.hdf5_writer import add_arrays, add_attributes, add_group, file_in_memory, image
from keras_pendulum.integrity import write_sealed
from keras_pendulum.network import DQN, Origin
from keras_pendulum.policy import ACTIVATIONS

_ORIGIN = "keras_pendulum"  # our group beside the layers; Keras ignores it
_OPTIONAL = ("gravity", "preset", "seed", "config")  # of Origin: left out where not known


def save_weights(
    network: DQN, path: str | os.PathLike[str], evaluated_return: float | None = None
) -> None:
    """Writes the network to `path`, replacing an old file only when the new one is whole.

    Keras 2 and Keras 3 open the file with `model.load_weights`.

    Args:
        network: the network; what its `origin` knows becomes attributes of the group
            `keras_pendulum`, beside the versions of what wrote the file.
        path: the file.
        evaluated_return: the mean return that `evaluate_policy(network)` gave, one more attribute.

    Raises:
        UserError: the file cannot be written, or `load_weights` would not take it.
    """
    content = weights_file(network, network.get_weights(), evaluated_return=evaluated_return)

    def read_back(file: Path) -> None:
        try:
            _read(file)
        except WeightsError as error:
            reason = str(error).removeprefix(f"{file}: ")
            raise UserError(f"cannot write {path}: it could not be loaded, {reason}") from error

    write_sealed(path, content, check=read_back)


def weights_file(
    network: DQN,
    weights: list[NDArray[np.float32]],
    *,
    evaluated_return: float | None = None,
    **groups: dict[str, NDArray[Any]],
) -> bytes:
    """The network's `.h5`, without its digest, with further groups of arrays beside the layers.

    Args:
        network: tells what it is and where it comes from.
        weights: its weights, as `get_weights` gives them.
        evaluated_return: see `save_weights`.
        groups: arrays by name, by the name of their group.

    Raises UserError when a weight is not finite: such a network is no policy.
    """
    require_finite(weights)
    about = {
        "version": __version__,
        "versions": json.dumps(_versions()),
        "activation": network.activation,
        "environment": network.origin.environment,
        **{name: getattr(network.origin, name) for name in _OPTIONAL},
        "evaluated_return": evaluated_return,
    }
    attributes = {
        name: value.encode() if isinstance(value, str) else value
        for name, value in about.items()
        if value is not None
    }
    with file_in_memory() as file:
        layer_files.write_layers(file, weights)
        add_attributes(add_group(file, _ORIGIN), attributes)
        for name, arrays in groups.items():
            add_arrays(add_group(file, name), arrays)
        return image(file)


def require_finite(arrays: Iterable[NDArray[Any]]) -> None:
    """Raises UserError when a number is not finite: no reader would take the file."""
    if not all(np.isfinite(array).all() for array in arrays):
        raise UserError("a weight is not finite, learning has diverged; nothing is saved")


def load_weights(path: str | os.PathLike[str]) -> DQN:
    """The network in a `.h5` of this package, of Keras 2, or of Keras 3 (`.weights.h5`).

    Layer sizes and action count are read from the file; a file that does not record its hidden
    activation is taken to use tanh.

    Raises:
        WeightsError: the file is missing, damaged, or not such a network; says what is wrong.
    """
    activation, origin, layers = _read(path)
    widths = [bias.shape[0] for bias in layers[1::2]]
    network = DQN(
        widths[:-1],
        widths[-1],
        observation_size=TASKS[origin.environment].observation_size,
        activation=activation,
        origin=origin,
    )
    network.set_weights(layers)
    return network


def _read(path: str | os.PathLike[str]) -> tuple[str, Origin, list[NDArray[np.float32]]]:
    """The hidden activation of a file's network, where it comes from, and its weights, checked."""
    with layer_files.opened(path) as file:
        activation, origin = _read_origin(file, path)
        task = TASKS[origin.environment]
        layers = layer_files.read_layers(file, path, task.observation_size)
    outputs = layers[-1].shape[0]
    if outputs < 2:
        raise WeightsError(f"{path}: the network has one output; expected one for each action")
    if task.action_count not in (None, outputs):
        raise WeightsError(
            f"{path}: the network has {outputs} outputs; {origin.environment} has "
            f"{task.action_count} actions"
        )
    return activation, origin, layers


def _read_origin(file: h5py.File, path: str | os.PathLike[str]) -> tuple[str, Origin]:
    about = {
        name: layer_files.text(value) if isinstance(value, bytes | str) else value
        for name, value in (file[_ORIGIN].attrs.items() if _ORIGIN in file else ())
    }
    activation = about.get("activation", "tanh")
    if activation not in ACTIVATIONS:
        raise WeightsError(
            f"{path}: records the activation {activation!r}; expected {' or '.join(ACTIVATIONS)}"
        )
    environment = about.get("environment", "Pendulum-v1")
    if environment not in TASKS:
        raise WeightsError(f"{path}: belongs to {environment!r}; expected {' or '.join(TASKS)}")
    gravity = about.get("gravity")
    if gravity is not None:
        try:
            gravity = checked_setting("gravity", gravity)
        except ConfigError as error:
            raise WeightsError(f"{path}: the recorded {error}") from error
    return activation, Origin(
        environment=environment,
        gravity=gravity,
        preset=about.get("preset"),
        seed=int(about["seed"]) if "seed" in about else None,
        config=about.get("config"),
    )


def _versions() -> dict[str, str]:
    """Of what made the numbers in the file."""
    import gymnasium
    import keras
    import tensorflow as tf

    return {
        "python": platform.python_version(),
        **{module.__name__: module.__version__ for module in (tf, keras, gymnasium, np)},
    }


def find_weights(name: str) -> Path:
    """The path of a weights file: `name` itself, or the shipped file `name`(.h5).

    Raises:
        WeightsError: there is no such file.
    """
    path = Path(name)
    try:
        if path.is_file():
            return path
    except OSError as error:  # a name that no file can have
        raise WeightsError(f"{name}: {error.strerror}; expected a weights file (.h5)") from error
    here = Path(__file__).parent
    # In a wheel the shipped weights lie inside the package, in a checkout beside it.
    for folder in (here / "shipped_weights", here.parent / "weights"):
        for candidate in (folder / name, folder / f"{name}.h5"):
            if path.name == name and candidate.is_file():
                return candidate
    problem = "not a file" if path.exists() else "no such file"
    raise WeightsError(f"{name}: {problem}; expected a weights file (.h5)")
