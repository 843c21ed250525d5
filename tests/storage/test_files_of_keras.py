"""Files that Keras 2 and Keras 3 save load as the same network, or are refused."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import keras
import numpy as np
import pytest
from conftest import Command
from keras_networks import CHAINS, NETWORKS, SUBCLASSED, WEIGHTS, WHOLE, Network, saved_files

import keras_pendulum as kp
from keras_pendulum.dqn.policy import greedy_policy

CASES = [
    pytest.param(name, version, id=f"{name}, Keras {version}")
    for name, network in NETWORKS.items()
    for version in network.versions
]
TOLERANCE = 1e-5


@pytest.fixture(scope="module")
def keras_versions() -> dict[int, Any]:
    tf_keras = pytest.importorskip("tf_keras", reason="Keras 2 comes with the extra `test`")
    return {2: tf_keras, 3: keras}


def observations(size: int = 3) -> np.ndarray[Any, Any]:
    return np.random.default_rng(1).normal(size=(50, size)).astype(np.float32)


def check(path: Path, network: Network, version: int, model: Any, **arguments: str) -> None:
    """Raises AssertionError unless `load_weights` follows the network's rule for the file."""
    rule = network.rule(path.name, version)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", UserWarning)
            loaded = kp.load_weights(path, **arguments)
    except kp.WeightsError as error:
        message = str(error)
        assert rule in ("refused", "either"), message
        assert str(path) in message
        assert message.isprintable()  # one line
        if path.name in WHOLE and network.blamed:
            words = message.replace(str(path), "")
            assert any(layer in words for layer in network.blamed), message
        return
    assert rule in ("loads", "either"), f"{path.name} loads as {loaded.hidden_units}"
    inputs = observations(network.inputs)
    expected = np.asarray(model(inputs), np.float32)
    for found in (loaded(inputs), greedy_policy(loaded).q_values(inputs)):
        np.testing.assert_allclose(found, expected, rtol=0, atol=TOLERANCE, err_msg=path.name)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "version"), CASES)
def test_whole_model_loads_as_the_same_network_or_is_refused_by_a_layer(
    name: str, version: int, keras_versions: dict[int, Any], tmp_path: Path
) -> None:
    network = NETWORKS[name]
    model = network.model(keras_versions[version])
    # A subclassed model records no activation.
    arguments = {"activation": network.activation} if name in SUBCLASSED else {}
    for path in saved_files(model, version, WHOLE, tmp_path):
        check(path, network, version, model, **arguments)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "version"), CASES)
def test_weights_alone_load_as_the_same_network_or_are_refused(
    name: str, version: int, keras_versions: dict[int, Any], tmp_path: Path
) -> None:
    network = NETWORKS[name]
    model = network.model(keras_versions[version])
    for path in saved_files(model, version, WEIGHTS, tmp_path):
        if network.rule(path.name, version) != "untested":
            check(path, network, version, model, activation=network.activation)


def test_matrix_has_at_least_forty_networks_that_must_load() -> None:
    assert len(CHAINS) >= 40
    assert len(NETWORKS) >= 100


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("suffix", ["h5", "keras"])
def test_recorded_activations_of_each_layer_are_those_of_the_loaded_network(
    version: int, suffix: str, keras_versions: dict[int, Any], tmp_path: Path
) -> None:
    model = NETWORKS["tanh, relu, linear"].model(keras_versions[version])
    model.save(tmp_path / f"a.{suffix}")
    loaded = kp.load_weights(tmp_path / f"a.{suffix}")
    assert loaded.activation == "tanh,relu,linear"


def test_network_of_mixed_activations_is_saved_and_loaded_unchanged(tmp_path: Path) -> None:
    NETWORKS["tanh, relu, linear"].model(keras).save(tmp_path / "a.keras")
    loaded = kp.load_weights(tmp_path / "a.keras")
    kp.save_weights(loaded, tmp_path / "b.h5")
    again = kp.load_weights(tmp_path / "b.h5")
    inputs = observations()
    np.testing.assert_array_equal(again(inputs), loaded(inputs))
    np.testing.assert_array_equal(loaded.clone()(inputs), loaded(inputs))


@pytest.mark.parametrize(
    ("version", "name"), [(2, "weights_alone.h5"), (2, "model.weights.h5"), (3, "model.weights.h5")]
)
def test_weights_alone_load_with_tanh_and_one_warning(
    version: int, name: str, keras_versions: dict[int, Any], tmp_path: Path
) -> None:
    model = NETWORKS["two hidden layers"].model(keras_versions[version])
    path = tmp_path / name
    model.save_weights(str(path))
    with pytest.warns(UserWarning) as caught:
        loaded = kp.load_weights(path)
    assert loaded.activation == "tanh"
    (message,) = (str(warning.message) for warning in caught)
    assert message.isprintable()  # one line
    assert all(word in message for word in (str(path), "tanh", "activation="))


def test_evaluate_takes_the_activation_or_warns_in_one_line(
    command: Command, tmp_path: Path
) -> None:
    NETWORKS["relu"].model(keras).save_weights(tmp_path / "a.weights.h5")
    words = ("evaluate", "a.weights.h5", "--episodes", "1", "--json")
    assumed = command(*words)
    assert assumed.returncode == 0
    (line,) = assumed.stderr.splitlines()
    assert all(word in line for word in ("a.weights.h5", "tanh", "--activation"))
    named = command(*words, "--activation", "relu")
    assert (named.returncode, named.stderr) == (0, "")


@pytest.mark.parametrize("name", ["elu", "Add"])
def test_page_refuses_another_network_in_one_line(
    name: str, command: Command, tmp_path: Path
) -> None:
    NETWORKS[name].model(keras).save(tmp_path / "a.keras")
    done = command("page", "a.keras")
    (line,) = done.stderr.splitlines()
    assert (done.returncode, done.stdout) == (2, "")
    assert line.startswith("error: ")
    assert "a.keras" in line
    assert "odd" in line
