"""The curves of examples/my_dqn.py, healthy and with four faults: docs/curves.png.

    python -m benchmarks.learning.training_curves

Trains the program with a few lines more, which log the curves of docs/curves.md, and writes their
values at the end of the run as `training_curves`.
"""

from __future__ import annotations

import importlib.util
import sys
import tempfile
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

import keras_pendulum as kp
from benchmarks.result_files import ROOT, Row, write

PICTURE = ROOT / "docs" / "curves.png"
PROGRAM = ROOT / "examples" / "my_dqn.py"
STEPS = 10_000  # a quarter of a run of the program
HEALTHY = "healthy"
# What differs from the program, by what the curve is called.
RUNS: dict[str, tuple[str, str]] = {
    HEALTHY: ("", ""),
    "no target network": ("COPY_EVERY = 50", "COPY_EVERY = 1"),
    "small replay buffer": ("CAPACITY = 50_000", "CAPACITY = 500"),
    "few updates": ("UPDATE_EVERY = 2 ", "UPDATE_EVERY = 100 "),
    "ε stays at 1": ("EPSILON = (1.0, 0.05 if", "EPSILON = (1.0, 1.0 if"),
}
# The lines that log, and those that they replace.
LOGGING = (
    (
        "        optimizer.apply(gradients, online.trainable_variables)\n",
        "        optimizer.apply(gradients, online.trainable_variables)\n"
        "        return loss, tf.reduce_mean(tf.abs(goal - value))\n",
    ),
    (
        "            update(*buffer.draw(random))\n",
        "            logged.append([float(each) for each in update(*buffer.draw(random))])\n",
    ),
    (
        "            returns.append(0.0)\n",
        "            returns.append(0.0)\n"
        "            if returns[1:]:\n"
        "                log_episode(online, buffer, returns[-2], epsilon, logged)\n"
        "            logged = []\n",
    ),
)
CURVES = {  # what is logged of each episode, in this order
    "return": "return",
    "ε": "epsilon",
    "loss": "loss",
    "TD error": "mean absolute TD error",
    "mean Q": "mean of max Q",
}
_STYLES = (
    ("black", "-"),
    ("#D55E00", "--"),
    ("#0072B2", "-."),
    ("#009E73", ":"),
    ("#CC79A7", (0, (5, 1, 1, 1))),
)
_LAST = 10  # episodes that the table means


def program(change: tuple[str, str], folder: Path) -> ModuleType:
    """Returns my_dqn.py as a module that logs, from a file in `folder`, where TensorFlow reads it.

    Raises ValueError where a line to replace is not there once.
    """
    text = PROGRAM.read_text(encoding="utf-8")
    for old, new in (*LOGGING, *([change] if change[0] else [])):
        if text.count(old) != 1:
            raise ValueError(f"{PROGRAM.name} has {text.count(old)} times: {old}")
        text = text.replace(old, new)
    path = folder / PROGRAM.name
    path.write_text(text, encoding="utf-8")
    spec = importlib.util.spec_from_file_location("logging_dqn", path)
    assert spec is not None and spec.loader is not None
    module = sys.modules[spec.name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def train(change: tuple[str, str], steps: int = STEPS) -> tuple[NDArray[Any], float]:
    """Returns the curves [episodes, 5] of a run, and the regret of its network."""
    with tempfile.TemporaryDirectory() as folder:
        my_dqn: Any = program(change, Path(folder))
        return _train(my_dqn, steps)


def _train(my_dqn: Any, steps: int) -> tuple[NDArray[Any], float]:
    rows: list[list[float]] = []

    def log_episode(
        online: Any, buffer: Any, episode_return: float, epsilon: float, logged: list[list[float]]
    ) -> None:
        # The states of the first episodes: the same in the whole run.
        highest = np.asarray(online(buffer.s[:1000])).max(axis=1).mean() / my_dqn.REWARD_SCALE
        loss, error = np.mean(logged, axis=0) if logged else (np.nan, np.nan)
        rows.append(
            [episode_return, float(epsilon), loss, error / my_dqn.REWARD_SCALE, float(highest)]
        )

    my_dqn.log_episode = log_episode
    network, _, _ = my_dqn.train(steps)
    score = kp.evaluate_policy(network, gravity=10.0, torques=my_dqn.ACTIONS)
    return np.array(rows), score.regret


def row(name: str, curves: NDArray[Any], regret: float) -> Row:
    """Returns the row of a run: the means of its last episodes."""
    returns, epsilon, loss, error, highest = np.nanmean(curves[-_LAST:], axis=0)
    return {
        "run": name,
        "return": f"{returns:.0f}",
        "loss": f"{loss:.4f}",
        "mean Q": f"{highest:.0f}",
        "ε": f"{epsilon:.2f}",
        "TD error": f"{error:.1f}",
        "regret": f"{regret:.0f}",
    }


def draw(runs: dict[str, NDArray[Any]], path: Path = PICTURE) -> None:
    """Draws a panel for each curve, with a line for each run."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 8), layout="constrained")
    panels = figure.subplots(3, 2).flat
    legend = figure.axes[-1]
    for number, (axes, (name, label)) in enumerate(zip(panels, CURVES.items(), strict=False)):
        for (run, curves), (color, line) in zip(runs.items(), _STYLES, strict=True):
            axes.plot(curves[:, number], color=color, linestyle=line, label=run)
        axes.set(title=name, xlabel="episode", ylabel=label)
        if name in ("loss", "TD error"):
            axes.set_yscale("log")
        if name == "mean Q":
            axes.set_yscale("symlog", linthresh=100)
    legend.axis("off")
    legend.legend(*figure.axes[0].get_legend_handles_labels(), loc="center", frameon=False)
    figure.savefig(path, dpi=80)


def main() -> None:
    """Trains all runs, writes their rows and the picture."""
    curves, rows = {}, []
    for name, change in RUNS.items():
        curves[name], regret = train(change)
        rows.append(row(name, curves[name], regret))
    write("training_curves", "python -m benchmarks.learning.training_curves", rows)
    draw(curves)


if __name__ == "__main__":
    main()
