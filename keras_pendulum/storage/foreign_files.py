"""Files of other libraries: what each is, and the line of code with which it becomes an agent.

None of them is loaded here. A pickle and a SavedModel can run code, and a PyTorch file does not
record how its layers are called.
"""

from __future__ import annotations

import re
import zipfile
from pathlib import Path
from typing import NamedTuple

from keras_pendulum.errors import LONGEST, WeightsError

_LARGEST_TEXT = 2**20  # bytes of the description in a file of Stable-Baselines3
_ALGORITHM = re.compile(rb"stable_baselines3\.(dqn|sac|td3|ddpg)\.policies")


class Kind(NamedTuple):
    """A kind of file."""

    name: str
    code: str  # Python that makes `agent` of it; PATH stands for the file

    def refusal(self, path: Path) -> WeightsError:
        """Returns the error, with the code and the command that work."""
        texts = [
            f"{path}: {self.name}; in mine.py: {self.code.replace('PATH', repr(shown))}; then give "
            "mine.py:agent"
            for shown in (str(path), path.name)
        ]
        # A long message would lose its middle, the code.
        return WeightsError(min(texts, key=len) if len(texts[0]) > LONGEST else texts[0])


_SAVED_MODEL = Kind(
    "a TensorFlow SavedModel may run code",
    "call = tf.saved_model.load(PATH).signatures['serving_default']; agent = kp.q_function(lambda "
    "x: [*call(tf.constant(x)).values()][0])",
)
_STATE_DICT = Kind(
    "a PyTorch file does not say how its layers are called",
    "net = YourNetwork(); net.load_state_dict(torch.load(PATH, weights_only=True)); agent = "
    "kp.q_function(net)",
)
_TORCH_SCRIPT = Kind(
    "a TorchScript file is a program", "agent = kp.q_function(torch.jit.load(PATH))"
)
_TORCH_MODULE = Kind(
    "a PyTorch module in a pickle may run code",
    "agent = kp.q_function(torch.load(PATH, weights_only=False)), after the import of its class",
)
_PICKLE = Kind("a pickle may run code", "agent = pickle.load(open(PATH, 'rb'))")
_CHECKPOINT = Kind(
    "a part of a TensorFlow checkpoint, without layers",
    "agent = your_model(), of tf_keras; agent.load_weights(PATH)",
)
_TORCH_ENDINGS = (".pth", ".pt", ".bin", ".ckpt")
_BY_ENDING = {
    ".pkl": _PICKLE,
    ".pickle": _PICKLE,
    ".joblib": _PICKLE._replace(code="agent = joblib.load(PATH)"),
    ".onnx": Kind(
        "an ONNX file",
        "run = onnxruntime.InferenceSession(PATH); agent = kp.q_function(lambda x: run.run(None, "
        "{run.get_inputs()[0].name: x})[0])",
    ),
    ".tflite": Kind(
        "a TensorFlow Lite file",
        "run = tf.lite.Interpreter(PATH).get_signature_runner(); agent = kp.q_function(lambda x: "
        "[*run(**{[*run.get_input_details()][0]: x}).values()][0])",
    ),
    ".safetensors": _STATE_DICT._replace(
        code="net = YourNetwork(); net.load_state_dict(safetensors.torch.load_file(PATH)); agent = "
        "kp.q_function(net)",
    ),
    ".json": Kind(
        "JSON without weights",
        "agent = keras.models.model_from_json(open(PATH).read()); agent.load_weights('YOUR.h5')",
    ),
}


def refuse_foreign(path: Path) -> None:
    """Raises WeightsError, with the code that works, for a file or folder of another library.

    Raises OSError where it cannot be read.
    """
    if path.is_dir():
        if (path / "saved_model.pb").is_file():
            raise _SAVED_MODEL.refusal(path)
        return
    with open(path, "rb") as file:
        start = file.read(4)
    ending = path.suffix.lower()
    if start == b"PK\x03\x04" and ending != ".keras":
        _refuse_archive(path)
    elif ending in _TORCH_ENDINGS and start[:1] == b"\x80":
        raise _STATE_DICT.refusal(path)
    elif ending == ".index" or ".data-" in ending:
        raise _CHECKPOINT.refusal(path.with_suffix(""))
    elif start != b"\x89HDF" and (kind := _BY_ENDING.get(ending)):
        raise kind.refusal(path)


def _refuse_archive(path: Path) -> None:
    """Raises WeightsError for the archives of PyTorch, Stable-Baselines3 and NumPy."""
    try:
        with zipfile.ZipFile(path) as archive:
            members = {name.rpartition("/")[2]: name for name in archive.namelist()}
            names, text = members.keys(), b""
            if described := members.get("data.pkl", members.get("data")):
                with archive.open(described) as file:
                    text = file.read(_LARGEST_TEXT)
    except Exception:  # damage causes any error of zipfile, and is reported later
        return
    if {"data", "policy.pth"} <= names:
        found = _ALGORITHM.search(text)
        algorithm = found[1].decode().upper() if found else "YourAlgorithm"
        raise Kind(
            "a model of Stable-Baselines3 has pickles",
            f"from stable_baselines3 import {algorithm}; agent = {algorithm}.load(PATH)",
        ).refusal(path)
    if "data.pkl" in names:
        if "constants.pkl" in names:
            raise _TORCH_SCRIPT.refusal(path)
        raise (_TORCH_MODULE if b"torch.nn" in text else _STATE_DICT).refusal(path)
    if {"observation.npy", "total.npy"} <= names:
        raise WeightsError(f"{path}: a record of a training; give your agent, and --record {path}")
    if names and all(name.endswith(".npy") for name in names):
        raise Kind(
            "a file of NumPy arrays does not say what they are",
            "w = np.load(PATH); agent = kp.q_function(lambda x: your_network(x, w))",
        ).refusal(path)
