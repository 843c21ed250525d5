"""The registration of DQN with Keras."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import keras_pendulum as kp
from keras_pendulum.keras_registration import _KerasFinder

LOAD = """
import numpy as np
{imports}
network = keras.models.load_model({path!r})
np.save({path!r} + ".npy", network(np.ones((2, 3), np.float32)))
"""


@pytest.mark.quick
def test_search_for_keras_does_not_import_it() -> None:
    code = (
        "import importlib.util, sys, keras_pendulum\n"
        "assert importlib.util.find_spec('keras') is not None\n"
        "assert 'keras' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.quick
def test_other_modules_and_a_missing_keras_are_not_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "meta_path", [])
    assert _KerasFinder().find_spec("numpy", None) is None
    assert _KerasFinder().find_spec("keras", None) is None


@pytest.mark.parametrize(
    "imports", ["import keras_pendulum, keras", "import keras, keras_pendulum"]
)
def test_keras_loads_a_saved_network_where_the_package_is_imported(
    imports: str, tmp_path: Path
) -> None:
    network = kp.DQN((8,), activation="relu", seed=3)
    path = str(tmp_path / "a.keras")
    network.save(path)
    subprocess.run([sys.executable, "-c", LOAD.format(imports=imports, path=path)], check=True)
    np.testing.assert_array_equal(np.load(path + ".npy"), network(np.ones((2, 3), np.float32)))
