"""The results of the presets, and the shipped weights.

    python -m benchmarks.learning.preset_results [SEEDS [PRESET …]]

Trains the presets below with the training seeds 0, 1, … (20 seeds), two runs at a time, and
evaluates each run greedily on the starts of seeds 0 to 99, of CartPole on those of 0 to 999. Then
the command `keras_pendulum.train`, timed as a whole process with nothing else on the machine, makes
the runs whose weights are shipped: seed 0 of each preset, but of `original` the repetition of the
recorded run (seed 1 from its initial weights). Writes the networks to weights/. With PRESETs, it
makes only these and keeps the other rows of the last results. It takes half an hour on two cores.
"""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path

import numpy as np

import keras_pendulum as kp
from benchmarks.learning.variants import interval, two_processes
from benchmarks.recorded_runs.pendulum import initial_network
from benchmarks.result_files import ROOT, Row, rows_of, write
from benchmarks.speed.processes import run_process
from keras_pendulum.storage.shipped_weights import shipped_returns

PRESETS = ("original", "reference", "swingup", "cartpole")


def train_and_evaluate(config: kp.Config) -> kp.Score:
    """Trains; returns the score on the starts of seeds 0 to 99, of CartPole of 0 to 999."""
    starts = 100 if config.task.has_exact_values else 1000
    return kp.evaluate_policy(kp.train_dqn(config).network, episodes=starts)


def ship(preset: str, folder: Path) -> float:
    """Trains with the command, and writes the shipped file and its return.

    Returns the command's seconds.
    """
    arguments = ["--preset", preset, "--seed", "0", "--out", str(folder / preset)]
    if preset == "original":
        kp.save_weights(initial_network(preset), folder / "initial.h5")
        arguments += ["--seed", "1", "--init", str(folder / "initial.h5")]
    process = run_process("-m", "keras_pendulum.train", *arguments)
    checkpoint = kp.preset(preset).task.weights_name
    network = kp.load_weights(folder / preset / checkpoint)
    mean_return = kp.evaluate_policy(network).mean_return
    path = ROOT / "weights" / f"{preset}.h5"
    kp.save_weights(network, path, evaluated_return=mean_return)
    returns = shipped_returns() | {preset: mean_return}
    (path.parent / "returns.json").write_text(json.dumps(returns, indent=2) + "\n", "utf-8")
    print(f"{path.name}: mean return {mean_return:.2f}, {process.seconds:.1f} s")
    return process.seconds


def table_row(preset: str, scores: list[kp.Score], seconds: float) -> Row:
    """Returns a row of the table."""
    gravity = scores[0].gravity
    return {
        "preset": f"`{preset}`",
        "task": scores[0].environment + ("" if gravity is None else f", g = {gravity:g}"),
        "best possible return": f"{scores[0].optimal_mean_return:.1f}",
        "mean return": f"{np.mean([score.mean_return for score in scores]):.1f}",
        "mean regret": f"{np.mean([score.regret for score in scores]):.1f}",
        "95 % interval": interval([score.regret for score in scores]),
        "worst run": f"{max(score.regret for score in scores):.1f}",
        "whole command": f"{seconds:.0f} s",
    }


def main(seeds: str = "20", *only: str) -> None:
    """Makes the runs of all presets, or of those in `only`; writes the table and the weights."""
    presets = only or PRESETS
    count = int(seeds)
    configs = [kp.preset(name, seed=seed) for name in presets for seed in range(count)]
    with two_processes() as pool:
        scores = pool.map(train_and_evaluate, configs, 1)
    with tempfile.TemporaryDirectory() as folder:
        rows = {
            f"`{name}`": table_row(
                name, scores[i * count : (i + 1) * count], ship(name, Path(folder))
            )
            for i, name in enumerate(presets)
        }
    if only:
        rows = {row["preset"]: row for row in rows_of("quality")} | rows
    write("quality", "python -m benchmarks.learning.preset_results", list(rows.values()))


if __name__ == "__main__":
    main(*sys.argv[1:])
