"""Makes `.keras` files whose model costs memory, time or trust, each from one sound model."""

from __future__ import annotations

import io
from collections.abc import Callable
from typing import Any

import h5py
import keras
import numpy as np
from hostile_files import Members, edited

L = keras.layers
Change = Callable[[Members], object]  # of the archive


def sound_model() -> Any:
    """Returns a model that `load_weights` does not know, with an operation beside its layers."""
    x = inputs = keras.Input((3,), name="observation")
    x = L.Dense(6, "gelu", name="features")(x)
    x = L.RepeatVector(2, name="twice")(x)
    x = L.LSTM(4, dropout=0.1, kernel_initializer=keras.initializers.HeNormal(seed=10**9))(x)
    value, advantage = L.Dense(1, name="value")(x), L.Dense(5, name="advantage")(x)
    mean = keras.ops.mean(advantage, axis=1, keepdims=True)
    return keras.Model(inputs, L.Add(name="q")([value, advantage - mean]))


def config(change: Callable[[list[Any]], object]) -> Change:
    """Returns a change of the list of layers."""
    return edited(lambda settings: change(settings["config"]["layers"]))


def text(old: str, new: str) -> Change:
    """Returns a change of the text of the configuration."""

    def apply(members: Members) -> None:
        assert old.encode() in members["config.json"]
        members["config.json"] = members["config.json"].replace(old.encode(), new.encode())

    return apply


def layer(name: str, **settings: Any) -> Change:
    """Returns a change of the settings of a layer; those of no layer replace its other entries."""

    def change(layers: list[Any]) -> None:
        (found,) = (each for each in layers if each["config"]["name"] == name)
        for key, value in settings.items():
            (found if key in found else found["config"])[key] = value

    return config(change)


def model_is(*layers: Any) -> Change:
    """Returns a change that replaces the model by a chain of layers; the weights stay."""
    return lambda members: members.update(
        {"config.json": keras.Sequential([keras.Input((3,)), *layers]).to_json().encode()}
    )


def weights(value: float) -> Change:
    """Returns a change of a weight."""

    def apply(members: Members) -> None:
        content = io.BytesIO(members["model.weights.h5"])
        with h5py.File(content, "r+") as file:
            file["layers/dense/vars/0"][0, 0] = value
        members["model.weights.h5"] = content.getvalue()

    return apply


def doubled(layers: list[Any]) -> None:
    """Calls a layer a thousand times."""
    nodes = next(each for each in layers if each["config"]["name"] == "twice")["inbound_nodes"]
    nodes *= 1000


STRANGE: dict[str, tuple[Change, str]] = {  # and what the message says
    "layer that runs code": (layer("twice", class_name="Lambda"), "twice is a Lambda"),
    "layer that imports PyTorch": (
        layer("twice", class_name="TorchModuleWrapper"),
        "twice is a TorchModuleWrapper",
    ),
    "layer of a user": (layer("twice", registered_name="a>b"), "twice is a RepeatVector"),
    "layer of another module": (layer("twice", module="os"), "twice is a RepeatVector"),
    "layer in a seed": (
        layer("features", seed={"module": "keras.layers", "class_name": "Lambda", "config": {}}),
        "features is a Lambda",
    ),
    "texts of 1 GB": (
        layer("twice", n={"class_name": "__numpy__", "config": {"value": [""], "dtype": "S1e9"}}),
        "twice is a __numpy__",
    ),
    "layer that is a list": (layer("twice", class_name=[1]), r"twice is a \[1\]"),
    "large number": (layer("twice", n=10**8), "twice has a number of 9 digits, more than 8192"),
    "large output": (layer("twice", n=8000), "recurrent layers have 8000 steps"),
    "weights that are not stored": (
        layer("features", units=8000),
        "its layers have .* weights, and the file has",
    ),
    "sizes that multiply": (
        model_is(L.RepeatVector(2000), L.Flatten(), L.RepeatVector(2000), L.Flatten()),
        "makes 12000000 numbers",
    ),
    "many layers": (model_is(*(L.Identity() for _ in range(200))), "more than 100"),
    "one layer many times": (config(doubled), "more than 100"),
    "long name": (text("twice", "1" * 10_000), "a text of 10000 characters"),
    "infinite number": (layer("twice", n=float("inf")), "twice has the number inf"),
    "number of 400 digits": (text('"n": 2', f'"n": {10**400}'), "twice has a number of 401 digits"),
    "no model": (
        lambda members: members.update({"config.json": b"{}"}),
        "holds a None, not a model",
    ),
    "nested deeply": (
        lambda members: members.update({"config.json": b'{"class_name":' * 90_000}),
        "",
    ),
    "huge weight": (weights(3e38), "has a weight of the size 3e.38; expected at most 1e.06"),
    "NaN": (weights(np.nan), "holds NaN"),
}
