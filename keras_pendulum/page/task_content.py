"""The content of the page for a task: its optimum, and the folder of its scripts and texts."""

from __future__ import annotations

import base64
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.environments.pendulum import Pendulum
from keras_pendulum.environments.task import Task
from keras_pendulum.optimum.cartpole_values import cartpole_value
from keras_pendulum.optimum.episode_values import LARGEST, differences, episode_values
from keras_pendulum.optimum.stored_results import split_words

CARTPOLE_DISCOUNT = 0.99

FOLDERS = {"Pendulum-v1": "pendulum", "CartPole-v1": "cartpole"}  # in web/


def optimum_content(task: Task) -> dict[str, Any]:
    """Returns the table of the optimal values that the scripts of the task read."""
    if isinstance(task, Pendulum):
        values = episode_values(task.gravity)
        rows, columns = values.roots.shape
        return {"rows": rows, "columns": columns, "scale": values.scale, **_table(values.roots)}
    # The optimal value at the first half of the grid points, in shares of the highest one.
    shares = cartpole_value(CARTPOLE_DISCOUNT) * (1 - CARTPOLE_DISCOUNT)
    return {"discount": CARTPOLE_DISCOUNT, **_table(np.rint(shares * LARGEST).astype(np.uint16))}


def _table(words: NDArray[np.uint16]) -> dict[str, str]:
    """Returns the compressed numbers as `start.js` reads them."""
    parts = split_words(differences(words))
    compressed = zlib.compress(b"".join(each.tobytes() for each in parts.values()), 9)
    return {"table": base64.b64encode(compressed).decode()}
