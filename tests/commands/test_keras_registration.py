"""The registration of DQN with Keras."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np

import keras_pendulum as kp

LOAD = """
import sys
import keras, keras_pendulum
import numpy as np
keras_pendulum.DQN
network = keras.models.load_model(sys.argv[1])
np.save(sys.argv[1] + ".npy", network(np.ones((2, 3), np.float32)))
"""


def test_keras_loads_a_saved_network_after_the_first_use_of_dqn(tmp_path: Path) -> None:
    network = kp.DQN((8,), activation="relu", seed=3)
    path = str(tmp_path / "a.keras")
    network.save(path)
    subprocess.run([sys.executable, "-c", LOAD, path], check=True)
    np.testing.assert_array_equal(np.load(path + ".npy"), network(np.ones((2, 3), np.float32)))
