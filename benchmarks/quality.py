"""How good the presets become: README's table of results, and the weights that are shipped.

    python -m benchmarks.quality [SEEDS]

Trains the presets below with the training seeds 0, 1, … (5 seeds), two at a time, and evaluates
each greedily on the starts of seeds 0 to 99. Then the command `keras_pendulum.train`, alone on the
machine and timed as a whole process, makes what is shipped: seed 0 of each, but of `original` the
twin of the recorded run (seed 1 from its initial weights). Writes the table into README.md and the
networks to weights/. A quarter of an hour on two cores.
"""

from __future__ import annotations

import multiprocessing
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

import keras_pendulum as kp
from benchmarks.report import best_mean_return, run_process, write
from keras_pendulum.environment import TASKS

PRESETS = ("original", "reference", "swingup", "cartpole")
MARKS = ("<!-- python -m benchmarks.quality -->", "<!-- end of the results -->")
_ROOT = Path(__file__).parents[1]
_RECORD = _ROOT / "tests" / "data" / "original_run_seed1.npz"


def score(config: kp.Config) -> kp.Score:
    """Trains, and evaluates on the starts of seeds 0 to 99."""
    return kp.evaluate_policy(kp.train_dqn(config).network)


def ship(preset: str, folder: Path) -> float:
    """Trains by the command, writes weights/PRESET.h5; returns the seconds it took."""
    words = ["--preset", preset, "--seed", "0", "--out", str(folder / preset)]
    if preset == "original":
        initial = kp.DQN()
        with np.load(_RECORD) as record:
            initial.set_weights([record[f"initial_weight_{i}"] for i in range(8)])
        kp.save_weights(initial, folder / "initial.h5")
        words += ["--seed", "1", "--init", str(folder / "initial.h5")]
    process = run_process("-m", "keras_pendulum.train", *words)
    weights = TASKS[kp.preset(preset).environment].weights_name
    network = kp.load_weights(folder / preset / weights)
    evaluated = kp.evaluate_policy(network)
    path = _ROOT / "weights" / f"{preset}.h5"
    kp.save_weights(network, path, evaluated_return=evaluated.mean_return)
    print(f"{path.name}: mean return {evaluated.mean_return:.2f}, {process.seconds:.1f} s")
    return process.seconds


def row(preset: str, scores: list[kp.Score], seconds: float) -> dict[str, Any]:
    """A line of the table."""
    best = best_mean_return(scores[0])
    regrets = [best - each.mean_return for each in scores]
    gravity = scores[0].gravity
    return {
        "preset": f"`{preset}`",
        "task": scores[0].environment + ("" if gravity is None else f", g = {gravity:g}"),
        "best possible return": f"{best:.1f}",
        "mean return": f"{np.mean([each.mean_return for each in scores]):.1f}",
        "mean regret": f"{np.mean(regrets):.1f}",
        "regret with seed 0, 1, …": ", ".join(f"{regret:.1f}" for regret in regrets),
        "whole command": f"{seconds:.0f} s",
    }


def main(seeds: int = 5) -> None:
    """Trains everything, writes the table and the weights."""
    configs = [kp.preset(name, seed=seed) for name in PRESETS for seed in range(seeds)]
    # Fresh processes, because TensorFlow does not survive a fork.
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        scores = pool.map(score, configs, 1)
    with tempfile.TemporaryDirectory() as folder:
        rows = [
            row(name, scores[i * seeds : (i + 1) * seeds], ship(name, Path(folder)))
            for i, name in enumerate(PRESETS)
        ]
    table = write("quality", "python -m benchmarks.quality", rows)
    readme = _ROOT / "README.md"
    before, rest = readme.read_text(encoding="utf-8").split(MARKS[0])
    after = rest.split(MARKS[1])[1]
    readme.write_text(f"{before}{MARKS[0]}\n{table}{MARKS[1]}{after}", encoding="utf-8")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
