"""Tests of the files in which other people have their networks: read, or one line that works."""

from __future__ import annotations

import json
import pickle
import re
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import keras
import numpy as np
import pytest
import tensorflow as tf
import torch
from keras import layers

import keras_pendulum as kp
from keras_pendulum.evaluate.named_policy import named_policy

tf_keras = pytest.importorskip("tf_keras")
OBSERVATIONS = np.random.RandomState(0).normal(size=(4, 3)).astype(np.float32)


def require_refused(path: Path, message: str) -> None:
    with pytest.raises(kp.WeightsError, match=message):
        named_policy(str(path))


class YourNetwork(torch.nn.Module):
    def __init__(self) -> None:
        super().__init__()
        self.first, self.last = torch.nn.Linear(3, 8), torch.nn.Linear(8, 5)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        answer: torch.Tensor = self.last(torch.relu(self.first(x)))
        return answer


def dueling(library: Any) -> Any:
    source = library.Input((3,))
    hidden = library.layers.Dense(8, "relu")(source)
    value, advantage = library.layers.Dense(1)(hidden), library.layers.Dense(5)(hidden)
    return library.Model(source, library.layers.Add()([value, advantage]))


def sequential(library: Any, *between: Any, shape: Any = (3,)) -> Any:
    first = [library.layers.Input(shape)]
    last = [library.layers.Dense(5)]
    return library.Sequential([*first, *between, *last])


def never_called(library: Any) -> Any:
    class Subclassed(library.Model):
        def __init__(self) -> None:
            super().__init__()
            self.hidden = library.layers.Dense(8, "tanh")
            self.head = library.layers.Dense(5)
            self.unused = library.layers.Dense(7)

        def call(self, x: Any) -> Any:
            return self.head(self.hidden(x))

    model = Subclassed()
    model(OBSERVATIONS)
    return model


MODELS: dict[str, Callable[[Any], Any]] = {
    "dueling": dueling,
    "LeakyReLU": lambda k: sequential(k, k.layers.Dense(8), k.layers.LeakyReLU()),
    "ReLU": lambda k: sequential(k, k.layers.Dense(8), k.layers.ReLU()),
    "bounded ReLU": lambda k: sequential(k, k.layers.Dense(8), k.layers.ReLU(max_value=0.5)),
    "Flatten": lambda k: sequential(k, k.layers.Flatten(), k.layers.Dense(8), shape=(1, 3)),
    "Dense of [1, 3]": lambda k: sequential(k, k.layers.Dense(8), shape=(1, 3)),
    "normalised": lambda k: sequential(k, k.layers.Dense(8), k.layers.BatchNormalization()),
}


@pytest.mark.parametrize("ending", [".h5", ".keras"])
@pytest.mark.parametrize("library", [keras, tf_keras], ids=["Keras 3", "Keras 2"])
@pytest.mark.parametrize("name", MODELS)
def test_whole_models_are_read(name: str, library: Any, ending: str, tmp_path: Path) -> None:
    if library is tf_keras and ending == ".keras":
        pytest.skip("a .keras file is of Keras 3")
    model = MODELS[name](library)
    path = tmp_path / f"model{ending}"
    model.save(path)
    inputs = OBSERVATIONS[:, None] if len(model.input_shape) == 3 else OBSERVATIONS
    expected = np.reshape(model(inputs), (4, 5))
    assert named_policy(str(path)).q_values(OBSERVATIONS) == pytest.approx(expected, abs=1e-5)


@pytest.mark.parametrize("library", [keras, tf_keras], ids=["Keras 3", "Keras 2"])
def test_layers_that_are_never_called_change_nothing(library: Any, tmp_path: Path) -> None:
    model = never_called(library)
    path = tmp_path / ("model.weights.h5" if library is keras else "model.h5")
    model.save_weights(path)
    policy = named_policy(str(path), activation="tanh")
    assert policy.q_values(OBSERVATIONS) == pytest.approx(np.array(model(OBSERVATIONS)), abs=1e-5)


@pytest.mark.parametrize("name", ["dueling", "ReLU"])
def test_weights_alone_of_other_layers_are_refused(name: str, tmp_path: Path) -> None:
    path = tmp_path / "model.weights.h5"
    MODELS[name](keras).save_weights(path)
    require_refused(path, r"weights alone.*model\.save.*give mine\.py:agent")


def test_code_in_a_model_is_refused(tmp_path: Path) -> None:
    model = sequential(keras, layers.Dense(8), layers.Lambda(lambda x: x))
    for library_path in (tmp_path / "model.h5", tmp_path / "model.keras"):
        model.save(library_path)
        require_refused(library_path, r"is a Lambda; .*give file\.py:name")


def test_module_of_a_layer_in_h5_is_checked(tmp_path: Path) -> None:
    """A configuration may name any module; only the known ones are imported."""
    import h5py

    path = tmp_path / "model.h5"
    sequential(keras, layers.Dense(8), layers.LeakyReLU()).save(path)
    with h5py.File(path, "r+") as file:
        config = json.loads(file.attrs["model_config"])
        config["config"]["layers"][2] |= {"module": "antigravity", "registered_name": None}
        file.attrs["model_config"] = json.dumps(config)
    require_refused(path, "is a LeakyReLU; expected Keras's own layers")


def save_torch(path: Path) -> None:
    torch.save(YourNetwork().state_dict(), path)


def save_saved_model(path: Path) -> None:
    dueling(keras).export(path, verbose=False)


def save_pickle(path: Path) -> None:
    path.write_bytes(pickle.dumps(YourNetwork()))


FILES: dict[str, tuple[Callable[[Path], Any], str]] = {
    "net.pth": (save_torch, "a PyTorch file"),
    "net.pt": (save_torch, "a PyTorch file"),
    "old.pth": (
        lambda path: torch.save(
            YourNetwork().state_dict(), path, _use_new_zipfile_serialization=False
        ),
        "a PyTorch file",
    ),
    "whole.pt": (lambda path: torch.save(YourNetwork(), path), "a PyTorch module in a pickle may"),
    "script.pt": (
        lambda path: torch.jit.save(torch.jit.script(YourNetwork()), path),
        "a TorchScript file",
    ),
    "net.pkl": (save_pickle, "a pickle may run code"),
    "saved": (save_saved_model, "a TensorFlow SavedModel"),
}


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.parametrize("name", FILES)
def test_code_of_the_message_makes_an_agent(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    save, kind = FILES[name]
    path = Path(name)
    save(path)
    with pytest.raises(kp.WeightsError) as caught:
        named_policy(str(path))
    message = str(caught.value)
    assert message.startswith(f"{path}: {kind}") and "\n" not in message
    found = re.fullmatch(r".*?; in mine\.py: (.*); then give mine\.py:agent", message)
    assert found is not None
    variables: dict[str, Any] = {
        **{"YourNetwork": YourNetwork, "kp": kp, "tf": tf, "torch": torch, "pickle": pickle}
    }
    exec(found[1].removesuffix(", after the import of its class"), variables)  # as the user would
    agent = variables["agent"]
    if isinstance(agent, torch.nn.Module):
        agent = kp.q_function(agent)
    assert agent.q_values(OBSERVATIONS).shape == (4, 5)


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("net.onnx", b"\x08\x07", "an ONNX file"),
        ("net.tflite", b"\x1c\x00\x00\x00TFL3", "a TensorFlow Lite file"),
        ("net.safetensors", b"\x08\x00\x00\x00\x00\x00\x00\x00{}", "a PyTorch file"),
        ("model.json", b"{}", "JSON without weights"),
        ("ck.index", b"\x00\x00\x01", "agent.load_weights('ck')"),
        ("ck.data-00000-of-00001", b"\x00\x00\x01", "agent.load_weights('ck')"),
        ("net.joblib", b"\x80\x04", "joblib.load"),
        ("broken.zip", b"PK\x03\x04", "broken.zip: cannot be read|not a file of Keras|damaged"),
        ("broken.pth", b"PK\x03\x04", "broken.pth: cannot be read|not a file of Keras|damaged"),
    ],
)
def test_other_files_get_one_line(
    name: str, content: bytes, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    path = Path(name)
    path.write_bytes(content)
    with pytest.raises(kp.WeightsError) as caught:
        named_policy(str(path))
    said = said if "|" in said else re.escape(said)
    assert re.search(said, str(caught.value)) and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("module", "algorithm"),
    [("dqn", "DQN"), ("sac", "SAC"), ("td3", "TD3"), ("common", "YourAlgorithm")],
)
def test_model_of_stable_baselines_is_loaded_by_it(
    module: str, algorithm: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    path = Path("best.zip")
    with zipfile.ZipFile(path, "w") as archive:
        text = f'{{"policy_class": {{"__module__": "stable_baselines3.{module}.policies"}}}}'
        archive.writestr("data", text)
        archive.writestr("policy.pth", b"")
    code = f"from stable_baselines3 import {algorithm}; agent = {algorithm}.load('{path}')"
    require_refused(path, re.escape(code))


def test_arrays_and_records_are_told_apart(tmp_path: Path) -> None:
    arrays, record = tmp_path / "w.npz", tmp_path / "run.npz"
    np.savez(arrays, w=np.zeros(3))
    require_refused(arrays, "a file of NumPy arrays")
    np.savez(record, observation=np.zeros(3), total=0)
    require_refused(record, r"a record of a training; .*--record")


def test_long_path_leaves_the_code_whole(tmp_path: Path) -> None:
    path = tmp_path / ("long" * 40) / "net.pth"
    path.parent.mkdir()
    save_torch(path)
    require_refused(path, r"torch\.load\('net\.pth', weights_only=True\)")


def test_model_of_a_class_of_ones_own_is_read_with_a_warning(tmp_path: Path) -> None:
    class Scaled(keras.Model):
        def __init__(self) -> None:
            super().__init__()
            self.hidden, self.head = layers.Dense(8, "tanh"), layers.Dense(5)

        def call(self, x: Any) -> Any:
            return self.head(self.hidden(x / 8))

    model = Scaled()
    model(OBSERVATIONS)
    path = tmp_path / "mine.keras"
    model.save(path)
    with pytest.warns(UserWarning, match=r"is a Scaled, whose code .* of your program: mine.py:ag"):
        kp.load_weights(path, "tanh")


def test_reason_of_keras_is_one_plain_line(tmp_path: Path) -> None:
    model = keras.Sequential(
        [keras.Input((3, 1)), layers.Conv1D(4, 2), layers.Flatten(), layers.Dense(5)]
    )
    path = tmp_path / "mine.keras"
    model.save(path)
    with pytest.raises(kp.UserError, match=r"give file\.py:name") as caught:
        kp.evaluate_policy(path, 1)
    assert "\\x1b" not in str(caught.value) and "\\n" not in str(caught.value)
