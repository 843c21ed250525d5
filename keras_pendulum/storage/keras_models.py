"""Loads whole models with other layers than Dense from `.keras` files, through Keras.

Keras builds whatever a configuration says: it reads other files, imports packages and allocates
what it says. So the file is read once, and Keras gets the checked bytes. Its layers are on a list,
and Keras first builds the model in a TensorFlow graph, which has all sizes and allocates nothing.
"""

from __future__ import annotations

import io
import json
import math
import os
import tempfile
import zipfile
from pathlib import Path
from typing import Any, NoReturn

import keras
import tensorflow as tf

from keras_pendulum.environments.pendulum import Pendulum
from keras_pendulum.errors import UnknownLayersError, UserError, WeightsError
from keras_pendulum.storage.keras_h5 import require_sane
from keras_pendulum.storage.model_config import read_model
from keras_pendulum.storage.quarantine import open_h5

_MEMBERS = {"config.json": 2**20, "metadata.json": 2**16, "model.weights.h5": 2**26}  # bytes
_MOST_LAYERS = 100  # and calls of layers
_LARGEST_NUMBER = 8192
_LONGEST_TEXT = 200
_LARGEST_OUTPUT = 16_384  # numbers for one observation, of each operation
_MODELS = {"Functional", "Model", "Sequential"}
_LAYERS = _MODELS | {
    *("InputLayer", "Dense", "EinsumDense", "Identity", "Masking", "Activation"),
    *("ReLU", "LeakyReLU", "PReLU", "ELU", "Softmax"),
    *("Add", "Subtract", "Multiply", "Average", "Maximum", "Minimum", "Concatenate", "Dot"),
    *("Flatten", "Reshape", "Permute", "RepeatVector", "Rescaling", "Normalization"),
    *("BatchNormalization", "GroupNormalization", "LayerNormalization", "RMSNormalization"),
    *("UnitNormalization", "SpectralNormalization", "ActivityRegularization"),
    *("Dropout", "AlphaDropout", "GaussianDropout", "GaussianNoise", "SpatialDropout1D"),
    *("Conv1D", "Conv1DTranspose", "DepthwiseConv1D", "SeparableConv1D"),
    *("AveragePooling1D", "MaxPooling1D", "GlobalAveragePooling1D", "GlobalMaxPooling1D"),
    *("Cropping1D", "UpSampling1D", "ZeroPadding1D"),
    *("LSTM", "GRU", "SimpleRNN", "RNN", "LSTMCell", "GRUCell", "SimpleRNNCell", "StackedRNNCells"),
    *("Bidirectional", "TimeDistributed"),
    *("Attention", "AdditiveAttention", "MultiHeadAttention"),
}
_PLACES_OF_LAYERS = {
    *("keras", "keras.layers", "keras.models"),
    *("keras.src.models.functional", "keras.src.models.sequential"),
}
# Operations such as Mean, and what layers are made with: none of them runs code or reads files.
_OPERATIONS = {f"keras.src.ops.{module}" for module in ("numpy", "nn", "math", "linalg")}
_PARTS = {"keras.initializers", "keras.regularizers", "keras.constraints", "keras.dtype_policies"}
_FURTHER = {("keras.src.ops.core", "Cast"), ("keras.random", "SeedGenerator")}
_VALUES = {"__keras_tensor__", "__tuple__", "__slice__", "__ellipsis__"}
_ARRAYS = {"__tensor__", "__numpy__"}
_TYPES = {"float32", "float64", "int32", "int64", "bool"}  # a text could have any length
_NOT_SIZES = {"seed", "shared_object_id"}


def load_keras_model(path: str | os.PathLike[str]) -> keras.Model:
    """Returns the model in a `.keras` file.

    Raises WeightsError when the file is damaged, when it holds another layer than those of the
    list, or sizes that its weights do not have.
    """
    name = os.fsdecode(path)
    with tempfile.TemporaryDirectory() as folder:
        weights = Path(folder, "model.weights.h5")  # private: no other program changes the bytes
        text = _unpack(name, weights)
        config = read_model(text, name)
        with open_h5(weights, name) as file:
            _require_known_layers(config, name)
            for array in file:
                file.read(array)  # which must be finite
            stored = sum(map(math.prod, file.shapes.values()))
        text = json.dumps(config)  # Keras changes a configuration that it reads
        try:
            _require_sizes(text, stored, name)
            model = _build(text)
            model.load_weights(weights)
            for weight in model.weights:
                require_sane(weight.numpy(), f"layer {weight.path}", name)
        except UserError:
            raise
        except Exception as error:  # which one depends on what the file lacks
            _refuse(name, f"({type(error).__name__}: {error})")
    return model


def _unpack(path: str, weights: Path) -> str:
    """Writes the HDF5 file in a `.keras` file, a ZIP archive, to `weights`; returns `config.json`.

    Raises WeightsError for other members than those of Keras, and for larger ones.
    """
    largest = sum(_MEMBERS.values())
    try:
        with open(path, "rb") as file:
            content = file.read(largest + 1)  # once
        if not content.startswith(b"PK\x03\x04") or len(content) > largest:
            raise WeightsError(
                f"{path}: not a .keras file of at most {largest >> 20} MiB; a model with other "
                "layers than Dense is loaded from such a file"
            )
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = [(each.filename, each.file_size) for each in archive.infolist()]
            names = [member for member, _ in members]
            for member, size in [*members, *((name, 0) for name in _MEMBERS)]:
                if size > _MEMBERS.get(member, -1) or names.count(member) != 1:
                    raise WeightsError(
                        f"{path}: holds {member} of {size} bytes; expected {', '.join(_MEMBERS)}, "
                        "once and not larger than usual; for another model, give file.py:name"
                    )
            weights.write_bytes(archive.read("model.weights.h5"))
            return archive.read("config.json").decode()
    except UserError:
        raise
    except Exception as error:  # damage causes any error of zipfile
        raise WeightsError(f"{path}: cannot be read, the file is damaged ({error})") from error


def _require_known_layers(config: dict[str, Any], path: str) -> None:
    """Raises UnknownLayersError for other classes than the known ones, and for large numbers.

    Removes what does not change the outputs: the optimizer's settings and unrolled loops.
    """
    if config.get("class_name") not in _MODELS:
        _refuse(path, f"it holds a {config.get('class_name')}, not a model")
    layers = 0
    pending: list[tuple[str, Any]] = [("", config)]  # with the name of the layer
    while pending:
        name, entry = pending.pop()
        if isinstance(entry, dict):
            entry.pop("compile_config", None)
            if entry.get("unroll"):
                entry["unroll"] = False
            if "class_name" in entry:
                settings = entry.get("config")
                name = str(settings.get("name", name) if isinstance(settings, dict) else name)
                if not _is_known(entry):
                    _refuse(
                        path,
                        f"layer {name} is a {entry['class_name']}; expected Keras's own layers of "
                        "vectors and sequences, such as Dense, Conv1D, LSTM and Add",
                    )
                if entry.get("module") in _PLACES_OF_LAYERS | _OPERATIONS:
                    calls = entry.get("inbound_nodes")
                    layers += max(1, len(calls) if isinstance(calls, list) else 0)
            for key, value in entry.items():
                if key not in _NOT_SIZES or not isinstance(value, int):
                    pending.append((name, value))
        elif isinstance(entry, list):
            pending += [(name, value) for value in entry]
        elif isinstance(entry, int) and abs(entry) > _LARGEST_NUMBER:
            _refuse(
                path,
                f"layer {name} has a number of {len(str(abs(entry)))} digits, more than "
                f"{_LARGEST_NUMBER}",
            )
        elif isinstance(entry, float) and not math.isfinite(entry):
            _refuse(path, f"layer {name} has the number {entry}")
        elif isinstance(entry, str) and len(entry) > _LONGEST_TEXT:
            _refuse(path, f"layer {name} has a text of {len(entry)} characters")
    if layers > _MOST_LAYERS:
        _refuse(path, f"it has {layers} layers and calls, more than {_MOST_LAYERS}")


def _is_known(entry: dict[str, Any]) -> bool:
    """Returns whether Keras makes an object of a known class from this part of a configuration."""
    kind, module = entry["class_name"], entry.get("module")
    if (
        not isinstance(kind, str)
        or not isinstance(module, str | None)
        or entry.get("registered_name") not in (None, kind)
    ):
        return False
    if kind == "function":
        return module == "builtins" and isinstance(entry.get("config"), str)
    if kind in _ARRAYS:
        settings = entry.get("config")
        return isinstance(settings, dict) and settings.get("dtype") in _TYPES
    return (
        kind in _VALUES
        or (module, kind) in _FURTHER
        or (module in _PLACES_OF_LAYERS and kind in _LAYERS | {"DTypePolicy"})
        or module in _OPERATIONS | _PARTS
    )


def _build(text: str) -> Any:
    return keras.saving.deserialize_keras_object(json.loads(text), safe_mode=True)


def _require_sizes(text: str, stored: int, path: str) -> None:
    """Raises UnknownLayersError for more weights than the file has, and for large outputs.

    Args:
        text: the configuration.
        stored: how many numbers the file stores.
        path: the file, for messages.
    """
    with tf.Graph().as_default() as graph:
        model = _build(text)
        needed = sum(math.prod(weight.shape) for weight in model.weights)
        if needed > stored:
            _refuse(path, f"its layers have {needed} weights, and the file has {stored}")
        observation = tf.zeros((1, Pendulum().observation_size))
        model(observation, training=False)
        computed = {observation.ref()}  # from the observation
        for operation in graph.get_operations():
            if any(each.ref() in computed for each in operation.inputs):
                for output in operation.outputs:
                    computed.add(output.ref())
                    size = output.shape.num_elements()
                    if size is None or size > _LARGEST_OUTPUT:
                        _refuse(
                            path,
                            f"{operation.name} makes {size} numbers of an observation, more than "
                            f"{_LARGEST_OUTPUT}",
                        )


def _refuse(path: str, found: str) -> NoReturn:
    raise UnknownLayersError(
        f"{path}: Keras cannot load it safely: {found}; for such a model, give file.py:name"
    )
