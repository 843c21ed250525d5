"""The page as one HTML file: the files of `web/` with the network's weights inside.

The weights are base64 of float32, so the page needs no server and no network connection.
"""

from __future__ import annotations

import base64
import json
import math
import re
from importlib import resources
from pathlib import Path
from typing import Any

from keras_pendulum.dqn.network import DQN, Provenance
from keras_pendulum.environments.tasks import TASKS
from keras_pendulum.errors import UserError
from keras_pendulum.evaluate.evaluation import evaluation_gravity
from keras_pendulum.storage.weights import recorded_return
from keras_pendulum.version import __version__

_WEB = resources.files("keras_pendulum.page") / "web"


def build_page(network: DQN, path: Path, gravity: float | None = None) -> bytes:
    """Returns the HTML file.

    Args:
        network: a network for Pendulum-v1.
        path: the file that the network was loaded from.
        gravity: m/s²; None takes the recorded one, else 1.

    Raises ConfigError for a gravity out of range, and UserError for a network of CartPole.
    """
    provenance = network.provenance
    if not TASKS[provenance.environment].has_torque:
        raise UserError(f"{path}: belongs to {provenance.environment}; the page shows Pendulum-v1")
    weights = b"".join(array.astype("<f4").tobytes() for array in network.get_weights())
    content = {
        "name": path.name,
        "preset": None if provenance.preset is None else str(provenance.preset),
        "gravity": evaluation_gravity(provenance, gravity),
        "trainedGravity": provenance.gravity,
        "evaluatedReturn": recorded_return(path),
        "sizes": [network.observation_size, *network.hidden_units, network.action_count],
        "activation": network.activation,
        "rewardScale": _reward_scale(provenance),
        "version": __version__,
        "weights": base64.b64encode(weights).decode(),
    }
    return _fill(content).encode()


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
