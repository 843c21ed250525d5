"""The duration and the regret of the training of a preset, here and in other libraries.

    python -m benchmarks.learning.reference_beside_libraries [reference|swingup [RUNS [PYTHON]]]

Trains with the settings of the preset and the training seeds 0, 1, …: `reference` in
Stable-Baselines3 and sbx (5 runs), `swingup`, the task of g = 10, in Stable-Baselines3 (3 runs).
`benchmarks.learning.other_libraries` says in which settings the libraries differ. Each run is a
process, and the libraries run in turns. The table has medians of the time from the start of a
process until its final weights are saved, and until its end. This package runs its command
`keras_pendulum.train`, which also writes checkpoints, draws a picture and evaluates; the others
only train. The last column counts the training seeds with which a library ends nearer to the
optimum than this package. `reference` takes eight minutes, `swingup` nine.

PYTHON runs the other libraries, by default the one of this package. Keras imports JAX and
Stable-Baselines3 imports TensorFlow if they are installed, so another environment, with nothing but
Gymnasium and the packages of the extra `peers`, is fairer. A library that is not installed is left
out.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.result_files import Row, write
from benchmarks.speed.processes import Process, in_turns, median, run_process

THIS_PACKAGE = "this package"
OTHER_LIBRARIES = "benchmarks.learning.other_libraries"
PEERS = {"stable-baselines3": "sb3", "sbx-rl": "sbx"}  # package: its name in OTHER_LIBRARIES
RESULTS = {"reference": "learning", "swingup": "learning_swingup"}
LIBRARIES = {"reference": [*PEERS], "swingup": ["stable-baselines3"]}
RUNS = {"reference": 5, "swingup": 3}


class Training(NamedTuple):
    """A process that has trained a network."""

    saved: float  # s, from its start until its final weights were saved
    process: Process
    weights: Path  # an .h5 of this package, an .npz of a peer


def train(weights: Path, *arguments: str, python: str = sys.executable) -> Training:
    """Runs `python -m ARGUMENTS`, which writes `weights`."""
    started = time.time()
    process = run_process("-m", *arguments, python=python)
    return Training(weights.stat().st_mtime - started, process, weights)


def regret(weights: Path, preset: str) -> float:
    """Returns the greedy regret of a preset's network on the starts of seeds 0 to 99."""
    import keras_pendulum as kp

    if weights.suffix == ".h5":
        return kp.evaluate_policy(kp.load_weights(weights)).regret
    with np.load(weights) as arrays:
        layers = [arrays[name] for name in arrays]
    config = kp.preset(preset)
    network = kp.DQN(config.hidden_units, config.torque_count, activation=config.activation)
    network.set_weights(layers)
    return kp.evaluate_policy(network, gravity=config.gravity).regret


def medians(trainings: Sequence[Training]) -> tuple[float, float]:
    """Returns the seconds until the weights were saved, and those of the whole process."""
    saved = [training.saved for training in trainings]
    return median(saved, 3), median([training.process.seconds for training in trainings], 3)


def table_rows(trainings: dict[str, list[Training]], regrets: dict[str, list[float]]) -> list[Row]:
    """Returns a row for each library, from its trainings and their regrets by seed."""
    saved_here, process_here = medians(trainings[THIS_PACKAGE])
    rows: list[Row] = []
    for name, measured in trainings.items():
        saved, process = medians(measured)
        rows.append(
            {
                "library": name,
                "seconds until its weights are saved": round(saved, 1),
                "this package's share": round(saved_here / saved, 2),
                "seconds of the whole process": round(process, 1),
                "this package's share of the process": round(process_here / process, 2),
                "peak memory, MB": round(max(each.process.peak_memory for each in measured)),
                "mean regret": round(float(np.mean(regrets[name])), 2),
                "regrets": [round(each, 2) for each in regrets[name]],
                "runs nearer to the optimum than here": sum(
                    theirs < ours
                    for theirs, ours in zip(regrets[name], regrets[THIS_PACKAGE], strict=True)
                ),
            }
        )
    return rows


def main(preset: str = "reference", runs: str = "", python: str = sys.executable) -> None:
    """Makes all runs and writes the table."""
    if preset not in RESULTS:
        raise SystemExit(f"error: {preset}: expected one of {', '.join(RESULTS)}")
    count = int(runs or RUNS[preset])
    installed = run_process("-m", OTHER_LIBRARIES, python=python).output.splitlines()
    libraries = [
        name for name in LIBRARIES[preset] if any(line.startswith(name) for line in installed)
    ]
    with tempfile.TemporaryDirectory() as folder:

        def train_library(name: str, seed: int) -> Training:
            if name == THIS_PACKAGE:
                out = Path(folder) / str(seed)
                command = ["keras_pendulum.train", "--preset", preset, "--seed", str(seed)]
                training = train(out / "pendulum_weight.h5", *command, "--out", str(out))
            else:
                weights = Path(folder) / f"{name}{seed}.npz"
                command = [OTHER_LIBRARIES, PEERS[name], preset, str(seed), str(weights)]
                training = train(weights, *command, python=python)
            print(f"{name} {training.saved:.1f} s, {training.process.seconds:.1f} s", flush=True)
            return training

        trainings = in_turns([THIS_PACKAGE, *libraries], train_library, count)
        regrets = {
            name: [regret(training.weights, preset) for training in measured]
            for name, measured in trainings.items()
        }

    command = f"python -m benchmarks.learning.reference_beside_libraries {preset} {count}"
    write(RESULTS[preset], command, table_rows(trainings, regrets), also=installed)


if __name__ == "__main__":
    main(*sys.argv[1:])
