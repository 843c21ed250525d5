"""Saves networks as `.h5` files in the layout of Keras 2, which Keras 3 loads too."""

from __future__ import annotations

import json
import os
import platform
from pathlib import Path
from typing import Any
from uuid import uuid4

import h5py
import numpy as np
from numpy.typing import NDArray

from keras_pendulum.dqn.network import DQN
from keras_pendulum.errors import UserError, WeightsError, require_finite, require_type
from keras_pendulum.limits import LARGEST_WEIGHT
from keras_pendulum.storage.checksum import write_with_checksum
from keras_pendulum.storage.load_weights import GROUP, read_network
from keras_pendulum.storage.quarantine import H5File
from keras_pendulum.version import __version__


def save_weights(
    network: DQN, path: str | os.PathLike[str], evaluated_return: float | None = None
) -> None:
    """Writes the network to `path`; an old file is replaced only when the new one is complete.

    Keras 2 and Keras 3 load the file with `model.load_weights`.

    Args:
        network: the network. Its metadata and the versions of the packages become attributes of the
            group `keras_pendulum`.
        path: the file.
        evaluated_return: the mean return of `evaluate_policy(network)`, one more attribute.

    Raises UserError when the file cannot be written, or when `load_weights` would reject it.

    >>> kp.save_weights(kp.DQN((64, 64), 5), "mine.h5")
    >>> kp.load_weights("mine.h5").hidden_units
    (64, 64)
    """
    require_type("network", network, DQN)
    require_type("path", path, (str, os.PathLike))
    if Path(path).suffix.lower() == ".keras":
        raise UserError(f"{path}: this writes HDF5, not a .keras file; name it FILE.h5")
    content = encode_weights(network, evaluated_return=evaluated_return)

    def read_back(file: Path) -> None:
        try:
            read_network(str(file))
        except WeightsError as error:
            reason = str(error).removeprefix(f"{file}: ")
            raise UserError(f"cannot write {path}: it could not be loaded, {reason}") from error

    write_with_checksum(path, content, check=read_back)


def encode_weights(
    network: DQN, *, evaluated_return: float | None = None, **groups: dict[str, NDArray[Any]]
) -> bytes:
    """Returns the network's `.h5` file without its checksum.

    Args:
        network: the network.
        evaluated_return: see `save_weights`.
        groups: further groups of arrays, by name.

    Raises UserError when a weight is not finite, or too large to be loaded.
    """
    weights = network.get_weights()
    require_finite(weights, LARGEST_WEIGHT)
    values = {
        "version": __version__,
        "versions": json.dumps(_versions()),
        "activation": network.activation,
        **network.metadata,
        "evaluated_return": evaluated_return,
    }
    # A unique name, because HDF5 does not open two files of one name, not even in memory.
    unique = f"{uuid4().hex}.h5"
    with h5py.File(unique, "w", driver="core", backing_store=False, block_size=2**23) as file:
        _write_layers(file, weights)
        attributes = file.create_group(GROUP).attrs
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


def _write_layers(file: h5py.File, arrays: list[NDArray[np.float32]]) -> None:
    """Writes kernel, bias, kernel, bias, … in the layout of Keras 2's `save_weights`."""
    names = ["dense" if i == 0 else f"dense_{i}" for i in range(len(arrays) // 2)]
    file.attrs["backend"] = np.bytes_("tensorflow")
    file.attrs["keras_version"] = np.bytes_("2.15.0")  # the version whose layout this is
    file.attrs["layer_names"] = np.array(names, "S")
    for name, kernel, bias in zip(names, arrays[::2], arrays[1::2], strict=True):
        layer = file.create_group(name)
        layer.attrs["weight_names"] = np.array([f"{name}/kernel:0", f"{name}/bias:0"], "S")
        for weight, array in {"kernel:0": kernel, "bias:0": bias}.items():
            layer.create_dataset(f"{name}/{weight}", data=array, track_times=False)
    file.create_group("top_level_model_weights").attrs["weight_names"] = np.array([], "S1")


def changed_versions(file: H5File) -> list[str]:
    """Returns the recorded `_versions` that are not the present ones, such as `keras 3.14.0`."""
    attributes = file.attributes[GROUP]
    recorded = {"keras_pendulum": attributes["version"], **json.loads(attributes["versions"])}
    present = {"keras_pendulum": __version__, **_versions()}
    return [f"{name} {recorded[name]}" for name in recorded if recorded[name] != present.get(name)]


def _versions() -> dict[str, str]:
    """Returns the versions and the number of threads that the last digits of a run depend on."""
    import gymnasium
    import keras
    import tensorflow as tf

    threads = "TF_NUM_INTRAOP_THREADS"  # 0: TensorFlow chooses
    return {
        "python": platform.python_version(),
        **{module.__name__: module.__version__ for module in (tf, keras, gymnasium, np)},
        threads: os.environ.get(threads, "0"),
    }
