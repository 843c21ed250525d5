"""The shipped weights, and how long their trainings take.

    python -m benchmarks.learning.preset_results [PRESET …]

The command `keras_pendulum.train`, timed as a whole process with nothing else on the machine, makes
the runs whose weights are shipped: seed 0 of each preset, but of `original` the repetition of the
recorded run (seed 1 from its initial weights). Writes the networks to weights/. With PRESETs, it
makes only these and keeps the other rows of the last results. It takes three minutes. The regrets
of more training seeds are those of `benchmarks.learning.study` and
`benchmarks.learning.departures`.
"""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path

import keras_pendulum as kp
from benchmarks.recorded_runs.pendulum import initial_network
from benchmarks.result_files import ROOT, Row, rows_of, write
from benchmarks.speed.processes import run_process
from keras_pendulum.storage.shipped_weights import shipped_returns

PRESETS = ("original", "reference", "swingup", "cartpole-original", "cartpole")


def ship(preset: str, folder: Path) -> Row:
    """Trains with the command, and writes the shipped file; returns a row of the table."""
    arguments = ["--preset", preset, "--seed", "0", "--out", str(folder / preset)]
    if preset == "original":
        kp.save_weights(initial_network(preset), folder / "initial.h5")
        arguments += ["--seed", "1", "--init", str(folder / "initial.h5")]
    process = run_process("-m", "keras_pendulum.train", *arguments)
    checkpoint = kp.preset(preset).task.weights_name
    network = kp.load_weights(folder / preset / checkpoint)
    score = kp.evaluate_policy(network)
    path = ROOT / "weights" / f"{preset}.h5"
    kp.save_weights(network, path, evaluated_return=score.mean_return)
    returns = shipped_returns() | {preset: score.mean_return}
    (path.parent / "returns.json").write_text(json.dumps(returns, indent=2) + "\n", "utf-8")
    print(f"{path.name}: mean return {score.mean_return:.2f}, {process.seconds:.1f} s")
    return {
        "preset": f"`{preset}`",
        "task": kp.preset(preset).task.name,
        "best possible return": f"{score.optimal_mean_return:.1f}",
        "return of the shipped network": f"{score.mean_return:.2f}",
        "whole command": f"{process.seconds:.0f} s",
    }


def main(*only: str) -> None:
    """Makes the runs of all presets, or of those in `only`; writes the weights and the table."""
    with tempfile.TemporaryDirectory() as folder:
        rows = {f"`{name}`": ship(name, Path(folder)) for name in only or PRESETS}
    if only:
        rows = {row["preset"]: row for row in rows_of("quality")} | rows
    write("quality", "python -m benchmarks.learning.preset_results", list(rows.values()))


if __name__ == "__main__":
    main(*sys.argv[1:])
