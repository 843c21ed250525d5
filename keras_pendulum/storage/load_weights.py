"""Loads networks from files of this package, of Keras 2 and of Keras 3.

`keras_h5` checks a file before a network is made from it. No loader of Keras reads the file.
"""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from keras_pendulum.dqn.network import DQN, REGISTERED_NAME
from keras_pendulum.dqn.policy import ACTIVATIONS, activations_of
from keras_pendulum.environments.cartpole import CartPole
from keras_pendulum.environments.pendulum import Pendulum
from keras_pendulum.environments.task import Task
from keras_pendulum.errors import ConfigError, WeightsError, require_type
from keras_pendulum.storage.find_weights import find_weights
from keras_pendulum.storage.keras_h5 import Layer, read_layers
from keras_pendulum.storage.model_config import read_model
from keras_pendulum.storage.quarantine import open_h5
from keras_pendulum.storage.run_info import RunInfo

_LARGEST_VALUE = 1e36  # less than a float32 can hold
GROUP = "keras_pendulum"  # a group beside the layers, which Keras ignores


def load_weights(path: str | os.PathLike[str], activation: str | None = None) -> DQN:
    """Returns the network in a file of this package, of Keras 2 or of Keras 3.

    The file is a `.h5`, a `.weights.h5` or a `.keras`. It determines layer sizes and action count,
    and in a whole model the activations.

    Args:
        path: the file, a run folder, or the name of a shipped file.
        activation: tanh, relu or linear, of the hidden layers, for a file that holds weights alone.
            Without it, and without a recorded one, they are tanh, with a warning. There is one,
            too, for a model of a class of the user's own: its layers are read as a chain.

    Raises WeightsError when the file is missing or damaged, does not hold such a network, or
    records another activation.

    >>> network = kp.load_weights("reference")
    >>> network.hidden_units, network.action_count, network.activation
    ((512, 256, 128), 41, 'tanh')
    """
    require_type("path", path, (str, os.PathLike))
    if activation is not None and activation not in ACTIVATIONS:
        raise ConfigError(f"activation is {activation}, expected {', '.join(ACTIVATIONS)}")
    name = os.fspath(find_weights(path))
    recorded, info, layers = read_network(name)
    if recorded is None:
        if activation is None:
            warnings.warn(
                f"{name} records no activation: its hidden layers get tanh; name another with "
                "activation= (--activation)",
                stacklevel=2,
            )
    elif activation not in (None, recorded):
        raise WeightsError(
            f"{name}: holds a network for {_task(info).environment} with the activation "
            f"{recorded}, not {activation}"
        )
    widths = [layer.bias.shape[0] for layer in layers]
    network = DQN(
        widths[:-1],
        widths[-1],
        observation_size=_task(info).observation_size,
        activation=recorded or activation or "tanh",
        metadata=info.as_record(),
    )
    network.set_weights([array for layer in layers for array in (layer.kernel, layer.bias)])
    return network


def recorded_return(path: str | os.PathLike[str]) -> float | None:
    """Returns the mean return that a weights file records, or None."""
    with open_h5(path) as file:
        value = file.attributes.get(GROUP, {}).get("evaluated_return")
    return float(value) if isinstance(value, int | float) and math.isfinite(value) else None


def read_network(path: str) -> tuple[str | None, RunInfo, list[Layer]]:
    """Returns the recorded activation, the run and the checked layers of a network."""
    with open_h5(path) as file:
        root = file.attributes[""]
        model = read_model(root["model_config"], path) if "model_config" in root else None
        attributes = file.attributes.get(GROUP, {})
        is_ours = model is not None and model.get("registered_name") == REGISTERED_NAME
        if model and is_ours:
            config = model["config"]
            attributes = {name: config[name] for name in config if config[name] is not None}
        info = read_info(attributes, path)
        if info.task is None and _takes_four(file.shapes.values()):
            info = replace(info, task=CartPole())
        task = _task(info)
        layers = read_layers(file, task.observation_size, model)
    if model and not is_ours and layers[-1].activation is None:
        warnings.warn(
            f"{path} is a {model['class_name']}, whose code it does not hold: it is read as a "
            "chain of its Dense layers. If its call does more, give the agent of your program: "
            "mine.py:agent",
            stacklevel=3,
        )
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
    _require_moderate_values(layers, activation or "linear", path)
    outputs = layers[-1].bias.shape[0]
    if outputs < 2:
        raise WeightsError(
            f"{path}: the network has one output; expected one for each action. An actor, whose "
            "output is a torque, is a function in your program: mine.py:act"
        )
    actions = task.action_count(outputs)
    if actions != outputs:
        raise WeightsError(
            f"{path}: the network has {outputs} outputs; {task.environment} has {actions} actions"
        )
    return activation, info, layers


def _require_moderate_values(layers: list[Layer], activation: str, path: str) -> None:
    """Raises WeightsError for weights with which the numbers of a deep network could overflow."""
    largest = 100.0  # of an observation
    names = [*activations_of(activation, len(layers) - 1), "linear"]
    for layer, name in zip(layers, names, strict=True):
        gains = np.abs(layer.kernel).sum(axis=0, dtype=np.float64)  # of the units
        largest = float((gains * largest + np.abs(layer.bias)).max())
        if largest > _LARGEST_VALUE:
            raise WeightsError(
                f"{path}: layer {layer.name} can give {largest:.1g}; expected at most "
                f"{_LARGEST_VALUE:g}: learning has diverged, or the file is damaged"
            )
        largest = min(largest, 1.0) if name == "tanh" else largest


def read_info(attributes: dict[str, Any], path: str) -> RunInfo:
    """Returns the run that the attributes of a file record. Raises WeightsError for wrong ones."""
    for name, value in attributes.items():
        if value is None:
            raise WeightsError(f"{path}: the attribute {name} is neither text nor a number")
    try:
        return RunInfo.from_record(attributes)
    except ConfigError as error:
        raise WeightsError(f"{path}: {error}") from error


def _takes_four(shapes: Iterable[tuple[int, ...]]) -> bool:
    """Returns whether a kernel has the inputs of CartPole, and none those of the pendulum."""
    inputs = {shape[0] for shape in shapes if len(shape) == 2}
    return CartPole().observation_size in inputs and Pendulum().observation_size not in inputs


def _task(info: RunInfo) -> Task:
    """Returns the recorded task; a file that records none is taken for one of the pendulum."""
    return info.task or Pendulum()
