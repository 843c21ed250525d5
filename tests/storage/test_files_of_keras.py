"""Files that Keras 2 and Keras 3 save load as the same network, or are refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any, get_args

import keras
import numpy as np
import pytest
from conftest import Command

import keras_pendulum as kp
from benchmarks.files.keras_files import check_files, observations
from benchmarks.files.keras_networks import NETWORKS, Order

pytestmark = pytest.mark.usefixtures("files_read_here")
# Each kind of layer, of model and of order; `benchmarks.files.keras_files` has all networks.
DRAWN = (
    *("two hidden layers", "tanh, relu, linear", "dense_10 before dense_2", "slashes in names"),
    *("names in other alphabets", "Dropout before Activation", "trained by Adam"),
    *("functional, created in another order", "attributes in another order"),
    *("equal widths, names before and behind `layers`", "list of equal widths, called backwards"),
    *("two Sequentials inside, called in another order", "this package's network of equal widths"),
    *("LeakyReLU", "BatchNormalization", "Normalization", "Rescaling", "Lambda", "Conv1D", "Add"),
    *("two inputs", "a layer used twice", "Flatten", "ReLU", "GaussianNoise"),
)


@pytest.fixture(scope="module")
def keras_versions() -> dict[int, Any]:
    tf_keras = pytest.importorskip("tf_keras", reason="Keras 2 comes with the extra `test`")
    return {2: tf_keras, 3: keras}


def test_25_networks_of_all_rules_are_drawn() -> None:
    assert len(DRAWN) == 25
    assert {NETWORKS[name].order for name in DRAWN} == set(get_args(Order))
    assert len(NETWORKS) >= 100


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "version"), [(name, version) for name in DRAWN for version in NETWORKS[name].versions]
)
def test_files_load_as_the_same_network_or_are_refused_by_a_layer(
    name: str, version: int, keras_versions: dict[int, Any], tmp_path: Path
) -> None:
    assert check_files(name, version, keras_versions[version], tmp_path)


def test_network_of_mixed_activations_is_saved_and_loaded_unchanged(tmp_path: Path) -> None:
    NETWORKS["tanh, relu, linear"].model(keras).save(tmp_path / "a.keras")
    loaded = kp.load_weights(tmp_path / "a.keras")
    assert loaded.activation == "tanh,relu,linear"
    kp.save_weights(loaded, tmp_path / "b.h5")
    again = kp.load_weights(tmp_path / "b.h5")
    inputs = observations()
    np.testing.assert_array_equal(again(inputs), loaded(inputs))
    np.testing.assert_array_equal(loaded.clone()(inputs), loaded(inputs))


def test_weights_alone_load_as_tanh_with_a_warning_unless_the_activation_is_given(
    in_process: Command, tmp_path: Path
) -> None:
    NETWORKS["relu"].model(keras).save_weights(tmp_path / "a.weights.h5")
    with pytest.warns(UserWarning, match=r"a\.weights\.h5 .* tanh.* activation=") as caught:
        assert kp.load_weights(tmp_path / "a.weights.h5").activation == "tanh"
    assert [str(each.message).isprintable() for each in caught] == [True]  # one line
    words = ("evaluate", "a.weights.h5", "--episodes", "1", "--json")
    assumed = in_process(*words)
    assert assumed.returncode == 0
    (line,) = assumed.stderr.splitlines()
    assert all(word in line for word in ("a.weights.h5", "tanh", "--activation"))
    named = in_process(*words, "--activation", "relu")
    assert (named.returncode, named.stderr) == (0, "")
