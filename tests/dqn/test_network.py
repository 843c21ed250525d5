"""The Q-network: its layers, its initial weights, its clone, and the run that it comes from."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import keras
import numpy as np
import pytest
import tensorflow as tf

import keras_pendulum as kp
from keras_pendulum.dqn.network import DQN
from keras_pendulum.dqn.policy import greedy_policy


def test_default_network_is_that_of_the_original() -> None:
    network = DQN()
    shapes = [(3, 512), (512,), (512, 256), (256,), (256, 128), (128,), (128, 41), (41,)]
    assert [weights.shape for weights in network.get_weights()] == shapes
    assert network.count_params() == 171_561
    assert network(np.zeros((5, 3), np.float32)).shape == (5, 41)


@pytest.mark.parametrize(
    ("activation", "hidden"), [("tanh", np.tanh), ("relu", lambda x: max(x, 0))]
)
def test_q_values_are_those_computed_by_hand(
    activation: str, hidden: Callable[[float], float]
) -> None:
    network = DQN((2,), 2, activation=activation)
    kernel = [[1, -1], [0, 0], [0.5, 0]]
    head = [[1, 2], [3, 4]]
    network.set_weights([np.array(array) for array in (kernel, [0.25, 0], head, [10, 20])])
    first, second = hidden(1 * 2 + 0.5 * -1 + 0.25), hidden(-1 * 2)
    expected = [[10 + first + 3 * second, 20 + 2 * first + 4 * second]]
    np.testing.assert_allclose(network(np.array([[2, 9, -1]], np.float32)), expected, rtol=1e-6)


@pytest.mark.parametrize("initial_weights", ["glorot", "fan-in", "spread"])
def test_initial_weights_depend_on_the_seed_alone(initial_weights: str) -> None:
    first = DQN((8, 8), seed=3, initial_weights=initial_weights)
    keras.utils.set_random_seed(77)
    again = DQN((8, 8), seed=3, initial_weights=initial_weights)
    other = DQN((8, 8), seed=4, initial_weights=initial_weights)
    for one, same, different in zip(
        first.get_weights(), again.get_weights(), other.get_weights(), strict=True
    ):
        np.testing.assert_array_equal(one, same)
        assert one.ndim == 1 or (one != different).any()


@pytest.mark.parametrize(
    ("initial_weights", "kernel_limits", "bias_limits"),
    [
        # √(6 / (inputs + outputs)) for 3, 400, 300 and 41.
        ("glorot", [0.1220269, 0.0925820, 0.1326470], [0, 0, 0]),
        # 1/√inputs for 3, 400 and 300 inputs.
        ("fan-in", [0.5773503, 0.05, 0.0577350], [0.5773503, 0.05, 0.0577350]),
        ("spread", [0.5773503, 0.0925820, 0.1326470], [0.3, 0.3, 0]),
    ],
)
def test_initial_weights_are_uniform_within_their_limits(
    initial_weights: str, kernel_limits: list[float], bias_limits: list[float]
) -> None:
    weights = DQN((400, 300), initial_weights=initial_weights).get_weights()
    for limits, arrays, reached in (
        (kernel_limits, weights[::2], 0.99),
        (bias_limits, weights[1::2], 0.9),
    ):
        for limit, array in zip(limits, arrays, strict=True):
            assert -limit * (1 + 1e-6) <= array.min() <= -reached * limit
            assert reached * limit <= array.max() <= limit * (1 + 1e-6)
            assert array.std() == pytest.approx(limit / np.sqrt(3), rel=0.15)


def test_kernels_of_one_network_differ() -> None:
    _, _, first, _, second, _, _, _ = DQN((8, 8, 8)).get_weights()
    assert (first != second).all()


def test_network_computes_in_float32_whatever_the_users_keras_computes_in() -> None:
    keras.config.set_floatx("float64")
    keras.config.set_dtype_policy("float64")
    try:
        network = DQN((8,))
    finally:
        keras.config.set_floatx("float32")
        keras.config.set_dtype_policy("float32")
    assert {weights.dtype for weights in network.get_weights()} == {np.dtype(np.float32)}
    assert network(np.zeros((1, 3), np.float32)).dtype == "float32"


def saved_and_loaded(network: DQN, folder: Path) -> Any:
    network.save(folder / "a.keras")
    return keras.models.load_model(folder / "a.keras")


@pytest.mark.parametrize(
    "copied",
    [
        lambda network, _: copy.deepcopy(network),
        lambda network, _: pickle.loads(pickle.dumps(network)),
        saved_and_loaded,
        lambda network, _: network.clone(),
    ],
    ids=["deepcopy", "pickle", "file of Keras", "clone"],
)
def test_copy_is_an_equal_network(copied: Callable[..., Any], tmp_path: Path) -> None:
    metadata = {"environment": "CartPole-v1", "preset": "cartpole", "seed": 3, "config": "{}"}
    network = DQN((8, 6), 2, observation_size=4, activation="relu,tanh", metadata=metadata)
    copy = copied(network, tmp_path)
    observations = np.random.RandomState(0).randn(5, 4).astype(np.float32)
    before = network(observations)
    np.testing.assert_array_equal(copy(observations), before)
    assert (type(copy), copy.metadata) == (DQN, metadata)
    assert copy.get_config() == network.get_config()
    copy.set_weights([weights + 1 for weights in copy.get_weights()])
    assert not np.array_equal(copy(observations), before)
    np.testing.assert_array_equal(network(observations), before)


def test_config_makes_any_number_of_networks_and_stays_as_it_is() -> None:
    network = DQN((8, 6), activation="relu,tanh", metadata={"gravity": 2.5, "seed": 3})
    config = network.get_config()
    first, second = DQN.from_config(config), DQN.from_config(config)
    assert config == first.get_config() == second.get_config() == network.get_config()


@pytest.mark.parametrize("activation", ["elu", "tanh,relu", "tanh,relu,tanh,relu"])
def test_unknown_activations_and_another_number_of_them_are_refused(activation: str) -> None:
    network = DQN((8, 8, 8), activation="tanh,relu,linear")
    assert [layer.activation.__name__ for layer in network.hidden] == ["tanh", "relu", "linear"]
    with pytest.raises((ValueError, KeyError)):
        greedy_policy(DQN((8, 8, 8), activation=activation))


OBSERVATIONS = np.random.RandomState(0).randn(5, 3).astype(np.float32)  # [B, D]


@pytest.fixture
def loaded(tmp_path: Path) -> DQN:
    """Returns a network as `load_weights` returns it, before its first call."""
    kp.save_weights(DQN((8, 6), activation="relu,tanh", seed=1), tmp_path / "a.h5")
    return kp.load_weights(tmp_path / "a.h5")


def q_values(network: DQN) -> Any:
    return network.clone()(OBSERVATIONS)


def test_loaded_network_predicts_without_being_compiled(loaded: DQN) -> None:
    np.testing.assert_allclose(
        loaded.predict(OBSERVATIONS, verbose=0), q_values(loaded), rtol=1e-6, atol=1e-7
    )


def test_loaded_network_is_exported_with_its_q_values(loaded: DQN, tmp_path: Path) -> None:
    loaded.export(tmp_path / "exported", verbose=False)
    exported = tf.saved_model.load(tmp_path / "exported")
    for batch in (OBSERVATIONS, OBSERVATIONS[:2]):
        np.testing.assert_allclose(exported.serve(batch), loaded(batch), rtol=1e-6, atol=1e-7)


def test_summary_of_a_loaded_network_has_the_size_of_each_layer(loaded: DQN) -> None:
    lines: list[str] = []
    loaded.summary(print_fn=lines.append, line_length=80)
    text = "\n".join(lines)
    for words in ("(None, 8)", "(None, 6)", "(None, 41)", "Total params: 373"):
        assert words in text


def test_weights_h5_of_keras_holds_an_equal_network(loaded: DQN, tmp_path: Path) -> None:
    path = tmp_path / "a.weights.h5"
    loaded.save_weights(path)
    copies = [keras.models.clone_model(loaded), DQN((8, 6), activation="relu,tanh", seed=7)]
    for other in copies:
        assert other.get_config() == loaded.get_config()
        assert not np.array_equal(other.get_weights()[0], loaded.get_weights()[0])
        other.load_weights(path)
    for other in copies:
        np.testing.assert_array_equal(other(OBSERVATIONS), loaded(OBSERVATIONS))


def test_loaded_network_can_be_a_layer_of_another_model(loaded: DQN) -> None:
    model = keras.Sequential([keras.Input((3,)), loaded, keras.layers.Softmax()])
    policy = model(OBSERVATIONS)
    np.testing.assert_allclose(policy, keras.ops.softmax(q_values(loaded)), rtol=1e-5, atol=1e-7)
