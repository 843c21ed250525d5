"""Weights files of this package, of Keras 2 and of Keras 3, and files that must be refused."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any

import h5py
import keras
import numpy as np
import pytest
import tensorflow as tf

import keras_pendulum as kp
from benchmarks.files.keras_networks import HEAD, dense, sequential, subclassed
from keras_pendulum.storage.keras_h5 import _split

pytestmark = pytest.mark.usefixtures("files_read_here")
OBSERVATIONS = np.random.RandomState(0).randn(20, 3).astype(np.float32)


def network() -> kp.DQN:
    metadata = {
        "environment": "Pendulum-v1",
        "gravity": 2.5,
        "preset": "reference",
        "seed": 7,
        "config": '{"seed": 7}',
    }
    return kp.DQN((16, 8), 5, seed=3, metadata=metadata)


def assert_same_values(found: Any, expected: Any, tolerance: float = 0) -> None:
    np.testing.assert_allclose(found(OBSERVATIONS), expected(OBSERVATIONS), rtol=0, atol=tolerance)


def test_load_weights_returns_the_saved_network_with_its_metadata(tmp_path: Path) -> None:
    saved = network()
    kp.save_weights(saved, tmp_path / "a.h5")
    loaded = kp.load_weights(tmp_path / "a.h5")
    for found, expected in zip(loaded.get_weights(), saved.get_weights(), strict=True):
        np.testing.assert_array_equal(found, expected)
    assert loaded.metadata == saved.metadata
    assert (loaded.hidden_units, loaded.action_count) == ((16, 8), 5)
    assert loaded.built


def test_same_network_makes_the_same_file_at_any_time(tmp_path: Path) -> None:
    kp.save_weights(network(), tmp_path / "a.h5", evaluated_return=-1.5)
    kp.save_weights(network(), tmp_path / "b.h5", evaluated_return=-1.5)
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()
    with h5py.File(tmp_path / "a.h5") as file:  # HDF5 can store times, in whole seconds
        assert h5py.h5g.get_objinfo(file.id, b"dense/dense/kernel:0").mtime == 0


def test_file_records_the_versions_of_the_packages_and_the_number_of_threads(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TF_NUM_INTRAOP_THREADS", "3")
    kp.save_weights(network(), tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5") as file:
        found = json.loads(file["keras_pendulum"].attrs["versions"])
    packages = {name: version(name) for name in ("keras", "gymnasium", "numpy")}
    python = ".".join(map(str, sys.version_info[:3]))
    threads = {"TF_NUM_INTRAOP_THREADS": "3"}
    assert found == {"python": python, "tensorflow": tf.__version__, **packages, **threads}


def test_keras_2_and_3_load_a_checkpoint(tmp_path: Path) -> None:
    keras2 = pytest.importorskip("tf_keras", reason="Keras 2 comes with the extra `test`")
    layers = [dense(16), dense(8), HEAD]
    builds = (sequential(*layers), subclassed({"all": layers}))  # as the original's
    config = kp.preset("reference", episodes=1, hidden_units=(16, 8), torque_count=5)
    result = kp.train_dqn(config, tmp_path)
    for model in (build(module) for build in builds for module in (keras, keras2)):
        model.load_weights(str(tmp_path / "pendulum_weight.h5"))
        assert_same_values(model, result.network, 1e-6)


def test_number_at_the_end_of_a_name_is_split_off() -> None:
    long = "1" * 10**6 + "x"  # in linear time
    names = {"dense_12": ("dense", 12), "dense12": ("dense", 12), "dense_": ("dense_", 0)}
    for name, parts in {**names, "12": ("", 12), long: (long, 0)}.items():
        assert _split(name) == parts


def make_changed(change: Callable[[h5py.File], None]) -> Callable[[Path], None]:
    """Returns a function that writes a valid file and changes something in it."""

    def make(path: Path) -> None:
        kp.save_weights(network(), path)
        with h5py.File(path, "r+") as file:
            change(file)

    return make


def replace_array(name: str, array: Any) -> Callable[[h5py.File], None]:
    def change(file: h5py.File) -> None:
        del file[name]
        file[name] = array

    return change


def attribute(name: str, value: object) -> Callable[[Path], None]:
    """Returns a function that writes a valid file, but with this attribute of its run."""
    return make_changed(lambda file: file["keras_pendulum"].attrs.__setitem__(name, value))


KERNEL, BIAS = "dense_1/dense_1/kernel:0", "dense_1/dense_1/bias:0"
BAD_FILES: dict[str, tuple[Callable[[Path], Any], str]] = {
    "no layers": (lambda path: h5py.File(path, "w").close(), "holds no network weights"),
    "other data": (make_changed(lambda f: f.attrs.pop("layer_names")), "no network weights"),
    "wrong width": (
        make_changed(replace_array(KERNEL, np.zeros((17, 8), "f4"))),
        "has 17 inputs; expected 16, the size of the previous layer",
    ),
    "wrong bias": (make_changed(replace_array(BIAS, np.zeros(9, "f4"))), "expected a kernel"),
    "missing bias": (make_changed(lambda f: f.__delitem__(BIAS)), f"has no array {BIAS}"),
    "integers": (
        make_changed(replace_array(KERNEL, np.zeros((16, 8), "i4"))),
        "expected floating-point",
    ),
    "activation": (attribute("activation", "elu"), "records the activation 'elu'"),
    "other environment": (
        attribute("environment", "CartPole-v1"),
        "has 3 inputs; expected 4, the size of an observation",
    ),
    "gravity": (attribute("gravity", np.nan), "gravity is nan; expected a number from 0 to 100"),
    "no text": (
        attribute("preset", np.bytes_(b"\xff")),
        "the attribute preset is neither text nor a number",
    ),
}


@pytest.mark.parametrize("kind", BAD_FILES)
def test_bad_file_is_refused_in_one_line_that_names_it(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "bad.h5"
    make, message = BAD_FILES[kind]
    make(path)
    before = path.read_bytes()
    with pytest.raises(kp.WeightsError) as caught:
        kp.load_weights(path)
    assert message in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)
    assert path.read_bytes() == before


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (lambda: kp.DQN((8,), 1), "the network has one output"),
        (lambda: kp.DQN((8193,), 2), "has 8193 units; expected 1 to 8192"),
        (lambda: kp.DQN((8,), observation_size=4), "has 41 outputs; CartPole-v1 has 2"),
        (lambda: kp.DQN((8,), observation_size=5), "has 5 inputs; expected 3"),
        (lambda: kp.DQN((8,), metadata={"gravity": 1000.0}), "gravity is 1000"),
        (
            lambda: kp.DQN((8,), metadata={"environment": "Acrobot-v1"}),
            "records the environment 'Acrobot-v1'",
        ),
    ],
)
def test_save_weights_refuses_a_network_that_could_not_be_loaded(
    make: Callable[[], kp.DQN], reason: str, tmp_path: Path
) -> None:
    path = tmp_path / "a.h5"
    path.write_bytes(b"old")
    with pytest.raises(kp.UserError) as caught:
        kp.save_weights(make(), path)
    assert str(caught.value).startswith(f"cannot write {path}: it could not be loaded, ")
    assert reason in str(caught.value)
    assert {file: file.read_bytes() for file in tmp_path.iterdir()} == {path: b"old"}


def test_failed_save_keeps_the_old_file_and_leaves_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.h5"
    path.write_bytes(b"old")

    def full_disk(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    for place, message in {
        path / "b.h5": "",
        tmp_path: "folder",
        tmp_path / "missing" / "a.h5": "No such file or directory",
    }.items():
        with pytest.raises(kp.UserError, match=f"cannot write .*: .*{message}"):
            kp.save_weights(network(), place)
    monkeypatch.setattr("os.fsync", full_disk)
    with pytest.raises(kp.UserError, match="No space left"):
        kp.save_weights(network(), path)
    assert {file: file.read_bytes() for file in tmp_path.iterdir()} == {path: b"old"}


def test_keras_file_of_a_dqn_loads_with_its_metadata(tmp_path: Path) -> None:
    saved = kp.DQN((5, 5, 5, 5), 5, activation="relu", metadata=network().metadata)
    saved.save(tmp_path / "a.keras")
    loaded = kp.load_weights(tmp_path / "a.keras")
    assert_same_values(loaded, saved)
    assert (loaded.metadata, loaded.activation) == (saved.metadata, "relu")


def test_activation_is_for_files_that_record_none(tmp_path: Path) -> None:
    sequential(dense(8), HEAD)(keras).save_weights(tmp_path / "a.weights.h5")
    assert kp.load_weights(tmp_path / "a.weights.h5", "relu").activation == "relu"
    kp.save_weights(kp.DQN((8,), activation="relu"), tmp_path / "b.h5")
    assert kp.load_weights(tmp_path / "b.h5", "relu").activation == "relu"
    with pytest.raises(kp.WeightsError, match="with the activation relu, not tanh"):
        kp.load_weights(tmp_path / "b.h5", "tanh")
    with pytest.raises(kp.ConfigError, match="activation is elu"):
        kp.load_weights(tmp_path / "a.weights.h5", "elu")


def test_network_that_is_not_finite_is_neither_saved_nor_loaded(tmp_path: Path) -> None:
    broken = network()
    broken.head.bias.assign([0, 1, np.nan, 3, 4])
    with pytest.raises(kp.UserError, match="a weight is not finite"):
        kp.save_weights(broken, tmp_path / "a.h5")
    broken.save_weights(tmp_path / "a.weights.h5")
    with pytest.raises(kp.WeightsError, match="head/vars/1 holds NaN or infinite numbers"):
        kp.load_weights(tmp_path / "a.weights.h5", "tanh")
    assert [file.name for file in tmp_path.iterdir()] == ["a.weights.h5"]
