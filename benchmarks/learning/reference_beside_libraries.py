"""The duration and the regret of the training of `reference`, here and in other libraries.

    python -m benchmarks.learning.reference_beside_libraries [RUNS [PYTHON]]

Trains with the settings of `reference` and the training seeds 0, 1, … (5 runs). Each run is a
process, and the libraries run in turns. The table has medians of the time from the start of a
process until its final weights are saved, and until its end. This package runs its command
`keras_pendulum.train`, which also writes checkpoints, draws a picture and evaluates; the others
only train. The last column counts the training seeds with which a library ends nearer to the
optimum than this package. It takes ten minutes.

PYTHON runs the other libraries; it belongs to an environment with the extra `bench`, by default to
the one of this package. Keras imports JAX if it is installed, so a separate environment is fairer
to this package. A library that is not installed is left out.
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


def regret(weights: Path) -> float:
    """Returns the greedy regret on the starts of seeds 0 to 99."""
    import keras_pendulum as kp

    if weights.suffix == ".h5":
        return kp.evaluate_policy(kp.load_weights(weights)).regret
    with np.load(weights) as arrays:
        layers = [arrays[name] for name in arrays]
    config = kp.preset("reference")
    network = kp.DQN(config.hidden_units, config.torque_count)
    network.set_weights(layers)
    return kp.evaluate_policy(network, gravity=config.gravity).regret


def medians(trainings: Sequence[Training]) -> tuple[float, float]:
    """Returns the seconds until the weights were saved, and those of the whole process."""
    saved = [training.saved for training in trainings]
    return median(saved, 3), median([training.process.seconds for training in trainings], 3)


def main(runs: str = "5", python: str = sys.executable) -> None:
    """Makes all runs and writes the table."""
    installed = run_process("-m", OTHER_LIBRARIES, python=python).output.splitlines()
    libraries = [name for name in PEERS if any(line.startswith(name) for line in installed)]
    with tempfile.TemporaryDirectory() as folder:

        def train_library(name: str, seed: int) -> Training:
            if name == THIS_PACKAGE:
                out = Path(folder) / str(seed)
                command = ["keras_pendulum.train", "--seed", str(seed), "--out", str(out)]
                training = train(out / "pendulum_weight.h5", *command)
            else:
                weights = Path(folder) / f"{name}{seed}.npz"
                command = [OTHER_LIBRARIES, PEERS[name], str(seed), str(weights)]
                training = train(weights, *command, python=python)
            print(f"{name} {training.saved:.1f} s, {training.process.seconds:.1f} s", flush=True)
            return training

        trainings = in_turns([THIS_PACKAGE, *libraries], train_library, int(runs))
        regrets = {
            name: [regret(training.weights) for training in measured]
            for name, measured in trainings.items()
        }

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
    write(
        "learning", "python -m benchmarks.learning.reference_beside_libraries", rows, also=installed
    )


if __name__ == "__main__":
    main(*sys.argv[1:])
