"""The page as one HTML file: the files of `web/` with the network's weights inside.

The weights are base64 of float32, so the page needs no server and no network connection.
"""

from __future__ import annotations

import base64
import json
import re
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from keras_pendulum.dqn.network import DQN
from keras_pendulum.environments.pendulum import Pendulum, require_pendulum
from keras_pendulum.optimum.value_iteration import solve
from keras_pendulum.storage.load_weights import recorded_return
from keras_pendulum.storage.run_info import RunInfo
from keras_pendulum.version import __version__

_WEB = resources.files("keras_pendulum.page") / "web"


THETA_CELLS = 400  # of the optimum's table
SPEED_STRIDE = 10  # keeps every tenth row: 0.05 rad/s apart


def build_page(
    network: DQN,
    path: Path,
    gravity: float | None = None,
    against: tuple[DQN, Path] | None = None,
    training: dict[str, Any] | None = None,
    name: str | None = None,
) -> bytes:
    """Returns the HTML file.

    Args:
        network: a network for Pendulum-v1.
        path: the file that the network was loaded from.
        gravity: m/s²; None takes the recorded one, else 1.
        against: a second network that is shown beside the first, and its file.
        training: the `training_content` of the network's run.
        name: the name of the network on the page; None takes that of the file.

    Raises ConfigError for a gravity out of range, and for a network of CartPole.
    """
    gravity = _gravity(network, path, gravity)
    content = _network_content(network, path, gravity) | {
        "version": __version__,
        "against": None,
        "training": training,
        "optimum": _optimum_content(gravity, THETA_CELLS),
    }
    if name is not None:
        content["name"] = name
    if against is not None:
        _gravity(*against, gravity)
        content["against"] = _network_content(*against, gravity)
    return _fill(content).encode()


def _gravity(network: DQN, path: Path, gravity: float | None) -> float:
    """Returns the gravity of the page. Raises ConfigError for a network of CartPole."""
    task = RunInfo.from_record(network.metadata).task or Pendulum()
    task = require_pendulum(task, f"{path}:", "the page shows Pendulum-v1")
    return task.with_gravity(gravity).gravity


def _network_content(network: DQN, path: Path, gravity: float) -> dict[str, Any]:
    """Returns what the page knows of a network."""
    info = RunInfo.from_record(network.metadata)
    weights = b"".join(array.astype("<f4").tobytes() for array in network.get_weights())
    return {
        "name": path.name,
        "preset": info.preset,
        "gravity": gravity,
        "trainedGravity": info.task.gravity if info.task else None,
        "evaluatedReturn": recorded_return(path),
        "sizes": [network.observation_size, *network.hidden_units, network.action_count],
        "activation": network.activation,
        "rewardScale": info.reward_scale,
        "weights": base64.b64encode(weights).decode(),
    }


@cache
def _optimum_content(gravity: float, cells: int) -> dict[str, Any]:
    """Returns the table of the optimal value of 200 steps; uint16 of its root, which is precise."""
    roots = np.sqrt(-solve(gravity, theta_cells=cells)[::SPEED_STRIDE])
    scale = float(roots.max()) / np.iinfo(np.uint16).max
    table = np.rint(roots / scale).astype("<u2")
    rows, columns = table.shape
    return {
        "rows": rows,
        "columns": columns,
        "scale": scale,
        "table": base64.b64encode(table.tobytes()).decode(),
    }


def _fill(content: dict[str, Any]) -> str:
    """Returns the page with its style sheet, its scripts and `content` inside."""

    def read(name: str) -> str:
        return (_WEB / name).read_text(encoding="utf-8")

    page = read("pendulum.html")
    page = re.sub(
        r'<link rel="stylesheet" href="(.+)">', lambda m: f"<style>\n{read(m[1])}</style>", page
    )
    page = re.sub(r'<script src="(.+)">', lambda m: f"<script>\n{read(m[1])}", page)
    # The name of a file may contain any text, even the end tag of a script.
    data = json.dumps(content, allow_nan=False).replace("<", r"\u003c")
    return page.replace('id="network">null<', f'id="network">{data}<')
