"""Keras gets the checked bytes of a stranger's `.keras` file, of known layers and stored sizes."""

from __future__ import annotations

import sys
import tempfile
import warnings
from pathlib import Path
from typing import Any

import keras
import numpy as np
import pytest
from hostile_files import change_members
from strange_models import STRANGE, sound_model, text

import keras_pendulum as kp
from keras_pendulum.evaluate.sources import load_keras_file
from keras_pendulum.storage import keras_models

pytestmark = pytest.mark.slow

MOST_MEMORY = 100  # MB


@pytest.fixture(autouse=True)
def temporary_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


def test_model_with_layers_of_the_list_is_loaded(tmp_path: Path, temporary_folder: Path) -> None:
    model = sound_model()
    model.save(tmp_path / "a.keras")
    # Only the configuration and the weights are read.
    change_members(tmp_path / "a.keras", lambda members: members.update({"assets/a": b"text"}))
    change_members(tmp_path / "a.keras", lambda members: members.pop("metadata.json"))
    loaded = load_keras_file(tmp_path / "a.keras")
    states = np.random.default_rng(0).normal(size=(9, 3)).astype(np.float32)
    np.testing.assert_array_equal(loaded(states), model(states))
    assert list(temporary_folder.iterdir()) == []


@pytest.mark.parametrize("kind", STRANGE)
def test_strange_model_is_refused_in_one_line(
    kind: str, tmp_path: Path, temporary_folder: Path
) -> None:
    change, message = STRANGE[kind]
    sound_model().save(tmp_path / "a.keras")
    change_members(tmp_path / "a.keras", change)
    before = memory()
    with (
        warnings.catch_warnings(action="error", category=RuntimeWarning),
        pytest.raises(kp.WeightsError, match=rf"a\.keras: .*({message})") as caught,
    ):
        load_keras_file(tmp_path / "a.keras")
    assert str(caught.value).isprintable()
    assert memory() - before < MOST_MEMORY
    assert list(temporary_folder.iterdir()) == []


def memory() -> float:
    """Returns the largest memory of this process so far, in MB; 0 on Windows."""
    if sys.platform == "win32":
        return 0.0
    import resource

    unit = 1e6 if sys.platform == "darwin" else 1e3
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit


def test_file_of_two_kinds_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sound_model().save(tmp_path / "a.h5")
    sound_model().save(tmp_path / "a.keras")
    both = (tmp_path / "a.h5").read_bytes() + (tmp_path / "a.keras").read_bytes()
    (tmp_path / "a.keras").write_bytes(both)
    monkeypatch.setattr(keras_models, "_build", None)
    with pytest.raises(kp.WeightsError, match=r"a\.keras: "):
        load_keras_file(tmp_path / "a.keras")


def test_file_that_is_replaced_after_its_checks_is_loaded_as_checked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.keras"
    model = sound_model()
    model.save(path)
    build = keras_models._build

    def replace_and_build(config: str) -> Any:
        path.write_bytes(b"another file")
        return build(config)

    monkeypatch.setattr(keras_models, "_build", replace_and_build)
    loaded = load_keras_file(path)
    assert isinstance(loaded, keras.Model)
    for found, expected in zip(loaded.get_weights(), model.get_weights(), strict=True):
        np.testing.assert_array_equal(found, expected)


def test_weights_with_which_a_deep_network_overflows_are_refused(tmp_path: Path) -> None:
    for activation, loads in (("tanh", True), ("relu", False)):
        network = kp.DQN((8,) * 7, 5, activation=activation)
        network.set_weights([np.full(each.shape, 9e5) for each in network.get_weights()])
        if loads:
            kp.save_weights(network, tmp_path / "a.h5")
        else:
            with pytest.raises(kp.UserError, match=r"layer dense_5 can give .* at most 1e\+36"):
                kp.save_weights(network, tmp_path / "a.h5")


@pytest.mark.parametrize("record", ['"preset": NaN', '"preset": [1]', '"seed": NaN', '"seed": []'])
def test_record_of_another_type_is_refused(record: str, tmp_path: Path) -> None:
    path = tmp_path / "a.keras"
    kp.DQN((8,), 5).save(path)
    change_members(path, text('"hidden_units"', f'{record}, "hidden_units"'))
    with pytest.raises(kp.WeightsError, match=r"a\.keras: records the (preset|seed) .*; expected"):
        kp.load_weights(path)


@pytest.mark.parametrize(("value", "loads"), [(1e5, True), (-1e7, False), (3e38, False)])
def test_weight_that_no_network_learns_is_refused(
    value: float, loads: bool, tmp_path: Path
) -> None:
    network = kp.DQN((4,), 5)
    arrays = network.get_weights()
    arrays[0][0, 0] = value
    network.set_weights(arrays)
    if loads:
        kp.save_weights(network, tmp_path / "a.h5")
        kp.load_weights(tmp_path / "a.h5")
    else:
        with pytest.raises(kp.UserError, match=r"beyond 1e\+06: learning has diverged"):
            kp.save_weights(network, tmp_path / "a.h5")
