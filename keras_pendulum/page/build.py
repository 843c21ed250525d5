"""The page as one HTML file: the files of `web/` with the network's weights inside.

The weights are base64 of float32, so the page needs no server and no network connection.
"""

from __future__ import annotations

import base64
import json
import math
import re
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from keras_pendulum.dqn.network import DQN, Provenance
from keras_pendulum.environments.tasks import TASKS
from keras_pendulum.errors import UserError
from keras_pendulum.evaluate.evaluation import evaluation_gravity
from keras_pendulum.optimum.value_iteration import solve
from keras_pendulum.storage.weights import recorded_return
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

    Raises ConfigError for a gravity out of range, and UserError for a network of CartPole.
    """
    gravity = _gravity(network, path, gravity)
    content = _network_content(network, path, gravity) | {
        "version": __version__,
        "against": None,
        "training": training,
        "optimum": _optimum_content(gravity),
    }
    if name is not None:
        content["name"] = name
    if against is not None:
        _gravity(*against, gravity)
        content["against"] = _network_content(*against, gravity)
    return _fill(content).encode()


def _gravity(network: DQN, path: Path, gravity: float | None) -> float:
    """Returns the gravity of the page. Raises UserError for a network of CartPole."""
    provenance = network.provenance
    if not TASKS[provenance.environment].has_torque:
        raise UserError(f"{path}: belongs to {provenance.environment}; the page shows Pendulum-v1")
    found = evaluation_gravity(provenance, gravity)
    assert found is not None  # only CartPole has none
    return found


def _network_content(network: DQN, path: Path, gravity: float) -> dict[str, Any]:
    """Returns what the page knows of a network."""
    provenance = network.provenance
    weights = b"".join(array.astype("<f4").tobytes() for array in network.get_weights())
    return {
        "name": path.name,
        "preset": None if provenance.preset is None else str(provenance.preset),
        "gravity": gravity,
        "trainedGravity": provenance.gravity,
        "evaluatedReturn": recorded_return(path),
        "sizes": [network.observation_size, *network.hidden_units, network.action_count],
        "activation": network.activation,
        "rewardScale": _reward_scale(provenance),
        "weights": base64.b64encode(weights).decode(),
    }


@cache
def _optimum_content(gravity: float) -> dict[str, Any]:
    """Returns the table of the optimal value of 200 steps; uint16 of its root, which is precise."""
    roots = np.sqrt(-solve(gravity, theta_cells=THETA_CELLS)[::SPEED_STRIDE])
    scale = float(roots.max()) / np.iinfo(np.uint16).max
    table = np.rint(roots / scale).astype("<u2")
    rows, columns = table.shape
    return {
        "rows": rows,
        "columns": columns,
        "scale": scale,
        "table": base64.b64encode(table.tobytes()).decode(),
    }


def _reward_scale(provenance: Provenance) -> float:
    """Returns the factor on the rewards of the recorded run; 1 if the file records none."""
    try:
        scale = float(json.loads(provenance.config or "{}")["reward_scale"])
    except (ValueError, TypeError, KeyError, OverflowError):
        return 1.0
    return scale if math.isfinite(scale) and scale > 0 else 1.0


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
