"""The page as one HTML file: the files of `web/` with the network's weights inside.

The scripts and the texts of a task are in a folder of their own in `web/`.

The weights are base64 of float32, so the page needs no server and no network connection. The
optimal values are 16-bit numbers: their differences, compressed, in base64.
"""

from __future__ import annotations

import base64
import json
import re
import zlib
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.dqn.network import DQN
from keras_pendulum.environments.pendulum import Pendulum
from keras_pendulum.environments.task import Task
from keras_pendulum.errors import ConfigError
from keras_pendulum.evaluate.q_policies import DQNPolicy
from keras_pendulum.figures.curves import PRESET_STYLES, curve_style
from keras_pendulum.optimum.cartpole_values import cartpole_value
from keras_pendulum.optimum.episode_values import LARGEST, differences, episode_values
from keras_pendulum.optimum.stored_results import split_words
from keras_pendulum.page.learning import learning_content
from keras_pendulum.storage.load_weights import recorded_return
from keras_pendulum.storage.run_info import RunInfo
from keras_pendulum.version import __version__

FOLDERS = {"Pendulum-v1": "pendulum", "CartPole-v1": "cartpole"}  # in web/
_CARTPOLE_DISCOUNT = 0.99
_WEB = resources.files("keras_pendulum.page") / "web"


def build_page(
    network: DQN,
    path: Path,
    task: Task,
    against: tuple[DQN, Path] | None = None,
    training: dict[str, Any] | None = None,
    name: str | None = None,
    lesson: bool = False,
) -> bytes:
    """Returns the HTML file.

    Args:
        network: a network for the task.
        path: the file that the network was loaded from.
        task: Pendulum-v1 or CartPole-v1.
        against: a second network, for the same environment, that is shown beside the first, and
            its file.
        training: the `training_content` of the network's run.
        name: the name of the network on the page; None takes that of the file.
        lesson: whether the page is that of the lesson, whose text is about the pendulum.

    Raises ConfigError for networks of two environments.
    """
    content = _network_content(network, path, task) | {
        "version": __version__,
        "against": None,
        "training": training,
        "optimum": _optimum_content(task),
        "learning": learning_content(task),
    }
    if name is not None:
        content["name"] = name
    if against is not None:
        other = DQNPolicy(against[0]).task.environment
        if other != task.environment:
            raise ConfigError(f"{against[1]}: belongs to {other}; {path} to {task.environment}")
        content["against"] = _network_content(*against, task)
    return _fill(content, FOLDERS[task.environment], lesson).encode()


def _network_content(network: DQN, path: Path, task: Task) -> dict[str, Any]:
    """Returns what the page knows of a network."""
    info = RunInfo.from_record(network.metadata)
    style = PRESET_STYLES.get(info.preset or "")
    weights = b"".join(array.astype("<f4").tobytes() for array in network.get_weights())
    return {
        "name": path.name,
        "preset": info.preset,
        "colour": None if style is None else curve_style(style)[0],
        "gravity": task.gravity,
        "trainedGravity": info.task.gravity if info.task else None,
        "evaluatedReturn": recorded_return(path),
        "sizes": [network.observation_size, *network.hidden_units, network.action_count],
        "activation": network.activation,
        "discount": info.discount,
        "rewardScale": info.reward_scale,
        "weights": base64.b64encode(weights).decode(),
    }


def _optimum_content(task: Task) -> dict[str, Any]:
    """Returns the table of the optimal values that the scripts of the task read."""
    if isinstance(task, Pendulum):
        values = episode_values(task.gravity)
        rows, columns = values.roots.shape
        return {"rows": rows, "columns": columns, "scale": values.scale, **_table(values.roots)}
    # The optimal value at the first half of the grid points, in shares of the highest one.
    shares = cartpole_value(_CARTPOLE_DISCOUNT) * (1 - _CARTPOLE_DISCOUNT)
    return {"discount": _CARTPOLE_DISCOUNT, **_table(np.rint(shares * LARGEST).astype(np.uint16))}


def _table(words: NDArray[np.uint16]) -> dict[str, str]:
    """Returns the compressed numbers as `start.js` reads them."""
    parts = split_words(differences(words))
    compressed = zlib.compress(b"".join(each.tobytes() for each in parts.values()), 9)
    return {"table": base64.b64encode(compressed).decode()}


def _fill(content: dict[str, Any], folder: str, lesson: bool) -> str:
    """Returns the page with its style sheet, its scripts, its texts and `content` inside."""

    def read(name: str) -> str:
        text = (_WEB / name).read_text(encoding="utf-8")
        return re.sub(r"^ +", "", text, flags=re.MULTILINE)  # the indentation is 20 KB

    texts = {"folder": folder, **json.loads(read(f"{folder}/texts.json"))}
    texts["scenes"] = read("scenes/scenes.html") if lesson else ""
    page = re.sub(r"\{\{(.+?)\}\}", lambda m: texts[m[1]], read("page.html"))
    page = re.sub(
        r'<link rel="stylesheet" href="(.+)">', lambda m: f"<style>\n{read(m[1])}</style>", page
    )
    page = re.sub(r'<script src="(.+)">', lambda m: f"<script>\n{read(m[1])}", page)
    # The name of a file may contain any text, even the end tag of a script.
    data = json.dumps(content, allow_nan=False).replace("<", r"\u003c")
    return page.replace('id="network">null<', f'id="network">{data}<')
