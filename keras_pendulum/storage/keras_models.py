"""Loads whole models with other layers than Dense from `.keras` and `.h5` files, through Keras.

Keras builds whatever a configuration says: it reads other files, imports packages and allocates
what it says. So the file is read once, and Keras gets the checked bytes. Its layers are on a list,
and Keras first builds the model in a TensorFlow graph, which has all sizes and allocates nothing.
"""

from __future__ import annotations

import json
import math
import os
import tempfile
from pathlib import Path
from typing import Any

import keras
import tensorflow as tf

from keras_pendulum.environments.tasks import TASKS
from keras_pendulum.errors import UnknownLayersError, UserError, WeightsError, reason_of
from keras_pendulum.storage.keras_h5 import require_sane
from keras_pendulum.storage.known_layers import modernised, refuse_model, require_known_layers
from keras_pendulum.storage.model_config import read_model
from keras_pendulum.storage.quarantine import open_h5

_LARGEST_FILE = 2**26  # bytes
_HDF5 = b"\x89HDF"
_RECURRENT = (keras.layers.RNN, keras.layers.Bidirectional, keras.layers.TimeDistributed)
_MOST_STEPS = 512  # of all recurrent layers together, each step of which takes time
_LARGEST_OUTPUT = 16_384  # numbers for one observation, of each operation


def load_keras_model(path: str | os.PathLike[str]) -> keras.Model:
    """Returns the model in a `.keras` file, or in an `.h5` file of a whole model.

    Raises WeightsError when the file is damaged, when it holds another layer than those of the
    list, or sizes that its weights do not have.
    """
    name = os.fsdecode(path)
    content = _read(name)
    is_h5 = content.startswith(_HDF5)
    with tempfile.TemporaryDirectory() as folder:
        # A private file: no other program changes the bytes. Keras asks the ending for the layout.
        private = Path(folder, "model.h5" if is_h5 else "model.keras")
        private.write_bytes(content)
        with open_h5(private, name) as file:
            recorded = file.attributes[""].get("model_config")
            if recorded is None:
                raise UnknownLayersError(
                    f"{name}: holds weights alone, of other layers than Dense: save the whole "
                    "model (model.save), or load them in mine.py and give mine.py:agent"
                )
            config = read_model(recorded, name)
            if is_h5:
                config = modernised(config)
            require_known_layers(config, name)
            for array in file.shapes:
                file.read(array)  # which must be finite
            stored = sum(map(math.prod, file.shapes.values()))
        text = json.dumps(config)  # Keras changes a configuration that it reads
        try:
            _require_sizes(text, stored, name)
            model = _build(text)
            model.load_weights(private)
            for weight in model.weights:
                require_sane(weight.numpy(), f"layer {weight.path}", name)
        except UserError:
            raise
        except Exception as error:  # which one depends on what the file lacks
            refuse_model(name, f"({type(error).__name__}: {reason_of(error)})")
    return model


def _read(path: str) -> bytes:
    """Returns the content of a file, read once.

    Raises WeightsError for a large file, and for one that is neither `.keras` nor HDF5.
    """
    try:
        with open(path, "rb") as file:
            content = file.read(_LARGEST_FILE + 1)
    except OSError as error:
        raise WeightsError(f"{path}: cannot be read ({error})") from error
    if not content.startswith((b"PK\x03\x04", _HDF5)) or len(content) > _LARGEST_FILE:
        raise WeightsError(
            f"{path}: not a .keras or .h5 file of at most {_LARGEST_FILE >> 20} MiB; a model with "
            "other layers than Dense is loaded from such a file"
        )
    return content


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
            refuse_model(path, f"its layers have {needed} weights, and the file has {stored}")
        layers = model._flatten_layers() if hasattr(model, "_flatten_layers") else model.layers
        steps = sum(each.input.shape[1] for each in layers if isinstance(each, _RECURRENT))
        if steps > _MOST_STEPS:
            refuse_model(path, f"its recurrent layers have {steps} steps, more than {_MOST_STEPS}")
        shape = getattr(model, "input_shape", ())
        sizes = [len(task.observation_names) for task in TASKS.values()]
        size = next((each for each in sizes if shape[-1:] == (each,)), sizes[0])
        alone = len(shape) == 3  # [None, 1, 3]
        observation = tf.zeros((1, 1, size) if alone else (1, size))
        model(observation, training=False)
        computed = {observation.ref()}  # from the observation
        for operation in graph.get_operations():
            if any(each.ref() in computed for each in operation.inputs):
                for output in operation.outputs:
                    computed.add(output.ref())
                    size = output.shape.num_elements()
                    if size is None or size > _LARGEST_OUTPUT:
                        refuse_model(
                            path,
                            f"{operation.name} makes {size} numbers of an observation, more than "
                            f"{_LARGEST_OUTPUT}",
                        )
