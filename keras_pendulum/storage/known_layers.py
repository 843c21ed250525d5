"""The layers of Keras that are built from a stranger's `.keras` file.

None of them runs code of the file, reads another file or imports a package.
"""

from __future__ import annotations

import math
from typing import Any, NoReturn

from keras_pendulum.errors import UnknownLayersError

_MOST_LAYERS = 100  # and calls of layers
_LARGEST_NUMBER = 8192
_LONGEST_TEXT = 200
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
_PLACE_OF_MODELS = {
    "Functional": "keras.src.models.functional",
    "Sequential": "keras.src.models.sequential",
}
# Operations such as Mean, and what layers are made with: none of them runs code or reads files.
_OPERATIONS = {f"keras.src.ops.{module}" for module in ("numpy", "nn", "math", "linalg")}
_PARTS = {"keras.initializers", "keras.regularizers", "keras.constraints", "keras.dtype_policies"}
_FURTHER = {("keras.src.ops.core", "Cast"), ("keras.random", "SeedGenerator")}
_VALUES = {"__keras_tensor__", "__tuple__", "__slice__", "__ellipsis__"}
_ARRAYS = {"__tensor__", "__numpy__"}
_TYPES = {"float32", "float64", "int32", "int64", "bool"}  # a text could have any length
_NOT_SIZES = {"seed", "shared_object_id"}


def require_known_layers(config: dict[str, Any], path: str) -> None:
    """Raises UnknownLayersError for other classes than the known ones, and for large numbers.

    Removes what does not change the outputs: the optimizer's settings and unrolled loops.
    """
    if config.get("class_name") not in _MODELS:
        refuse_model(path, f"it holds a {config.get('class_name')}, not a model")
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
                    refuse_model(
                        path,
                        f"layer {name} is a {entry['class_name']}; expected Keras's own layers of "
                        "vectors and sequences, such as Dense, Conv1D, LSTM and Add",
                    )
                if entry["class_name"] in _LAYERS or entry.get("module") in _OPERATIONS:
                    calls = entry.get("inbound_nodes")
                    layers += max(1, len(calls) if isinstance(calls, list) else 0)
            for key, value in entry.items():
                if key not in _NOT_SIZES or not isinstance(value, int):
                    pending.append((name, value))
        elif isinstance(entry, list):
            pending += [(name, value) for value in entry]
        elif isinstance(entry, int) and abs(entry) > _LARGEST_NUMBER:
            refuse_model(
                path,
                f"layer {name} has a number of {len(str(abs(entry)))} digits, more than "
                f"{_LARGEST_NUMBER}",
            )
        elif isinstance(entry, float) and not math.isfinite(entry):
            refuse_model(path, f"layer {name} has the number {entry}")
        elif isinstance(entry, str) and len(entry) > _LONGEST_TEXT:
            refuse_model(path, f"layer {name} has a text of {len(entry)} characters")
    if layers > _MOST_LAYERS:
        refuse_model(path, f"it has {layers} layers and calls, more than {_MOST_LAYERS}")


def modernised(config: Any) -> Any:
    """Returns the configuration of an `.h5` file as `.keras` files have it.

    The former does not name the modules of the layers, and Keras 2 names the shape of an input
    otherwise. Only classes of the list get a module.
    """
    if isinstance(config, list):
        return [modernised(each) for each in config]
    if not isinstance(config, dict):
        return config
    config = {key: modernised(value) for key, value in config.items()}
    kind, settings = config.get("class_name"), config.get("config")
    if kind in _LAYERS and "module" not in config:
        if kind == "Model":
            config["class_name"] = kind = "Functional"
        config |= {"module": _PLACE_OF_MODELS.get(kind, "keras.layers"), "registered_name": None}
        if kind != "InputLayer" and isinstance(settings, dict):
            axis = settings.get("axis")
            if kind == "BatchNormalization" and isinstance(axis, list) and len(axis) == 1:
                settings["axis"] = axis[0]
            shape = settings.pop("batch_input_shape", None)
            if isinstance(shape, list):
                settings["input_shape"] = shape[1:]
        if isinstance(settings, list):  # before Keras 2.2.3
            config["config"] = {"layers": settings}
    return config


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


def refuse_model(path: str, found: str) -> NoReturn:
    """Raises UnknownLayersError, with what was found."""
    raise UnknownLayersError(
        f"{path}: Keras cannot load it safely: {found}; for such a model, give file.py:name"
    )
