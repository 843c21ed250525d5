"""The content of the page for a task: its optimum, and the folder of its scripts and texts."""

from __future__ import annotations

import base64
from functools import cache
from typing import Any

import numpy as np

from keras_pendulum.environments.task import Task
from keras_pendulum.optimum.cartpole_values import cartpole_value
from keras_pendulum.optimum.value_iteration import solve

THETA_CELLS = 400  # of the pendulum's table
SPEED_STRIDE = 10  # keeps every tenth row: 0.05 rad/s apart
CARTPOLE_DISCOUNT = 0.99

FOLDERS = {"Pendulum-v1": "pendulum", "CartPole-v1": "cartpole"}  # in web/


def optimum_content(task: Task) -> dict[str, Any]:
    """Returns the table of the optimal values that the scripts of the task read."""
    if task.gravity is None:
        return _cartpole_optimum()
    return _pendulum_optimum(task.gravity, THETA_CELLS)


@cache
def _pendulum_optimum(gravity: float, cells: int) -> dict[str, Any]:
    """Returns the optimal value of 200 steps; uint16 of its root, which is precise."""
    roots = np.sqrt(-solve(gravity, theta_cells=cells)[::SPEED_STRIDE])
    scale = float(roots.max()) / np.iinfo(np.uint16).max
    table = np.rint(roots / scale).astype("<u2")
    rows, columns = table.shape
    return {"rows": rows, "columns": columns, "scale": scale, "table": _text(table)}


@cache
def _cartpole_optimum() -> dict[str, Any]:
    """Returns the optimal value for γ = 0.99 at the first half of the grid points; uint16.

    That of the other half is the value of the mirrored state.
    """
    highest = 1 / (1 - CARTPOLE_DISCOUNT)
    values = cartpole_value(CARTPOLE_DISCOUNT)
    table = np.rint(values / highest * np.iinfo(np.uint16).max).astype("<u2")
    return {"discount": CARTPOLE_DISCOUNT, "table": _text(table)}


def _text(table: np.ndarray[Any, Any]) -> str:
    return base64.b64encode(table.tobytes()).decode()
