"""Networks in files: our own and Keras's, and `.keras` files with layers that only Keras knows."""

from __future__ import annotations

import os
from pathlib import Path

import keras

from keras_pendulum.dqn.network import DQN
from keras_pendulum.errors import UnknownLayersError, WeightsError
from keras_pendulum.storage.find_weights import find_weights
from keras_pendulum.storage.weights import load_weights


def load_keras_file(
    path: str | os.PathLike[str], activation: str | None = None
) -> DQN | keras.Model:
    """Returns the network in a file.

    A chain of Dense layers is read by `load_weights`. A whole model with other layers, in a
    `.keras` file, is read by Keras in its safe mode, which runs no code of the file. Before, the
    file has passed the checks of `load_weights` up to the kind of its layers.

    Args:
        path: the file, or the name of a shipped one.
        activation: see `load_weights`.

    Raises WeightsError as `load_weights` does, and when Keras cannot read the file.
    """
    try:
        return load_weights(path, activation)
    except UnknownLayersError as unknown:
        file = find_weights(path)
        if Path(file).suffix.lower() != ".keras":
            raise UnknownLayersError(f"{unknown}; save other models as .keras") from unknown
        try:
            model = keras.saving.load_model(file, compile=False, safe_mode=True)
        except Exception as error:  # which one depends on what the file lacks
            raise WeightsError(
                f"{file}: Keras cannot load it ({type(error).__name__}: {error}); for a model with "
                "code of its own, give file.py:name"
            ) from error
    if not isinstance(model, keras.Model):
        raise WeightsError(f"{file}: holds a {type(model).__name__}; expected a Keras model")
    return model
