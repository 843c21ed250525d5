"""How long the task of `reference` takes here and in other libraries, and how well it ends.

    python -m benchmarks.learning [RUNS [PYTHON]]

Processes in turns, one for each of the training seeds 0, 1, … (3 runs), all with the numbers of the
preset `reference`; medians, from the start of a process until its final weights are kept, and until
it ends. This package's is the command `keras_pendulum.train` with all it does: checkpoints, and
afterwards a picture and an evaluation; and once more with its updates between the episodes, not
beside them. The others do nothing but train. They run under PYTHON, that of an environment with the
extra `bench`; by default the same as this package. Keras imports JAX where it finds it, so one of
their own is fairer. What is not installed is left out.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.report import Process, median, run_process, write

# Rows of this package, with the flags of each; the shares are those of the first.
OURS = {
    "this package": (),
    "this package, learning between the episodes": ("--update-after", "episode"),
}
PEERS = {"stable-baselines3": "sb3", "sbx-rl": "sbx"}  # package: name in benchmarks.peers


class Training(NamedTuple):
    """A process that has trained a network."""

    kept: float  # s, from its start until its final weights were kept
    process: Process
    weights: Path


def regret(weights: Path) -> float:
    """Greedy regret on the starts of seeds 0 to 99, of an .h5 or of a peer's .npz."""
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
    """Seconds until the weights were kept, and of the whole processes."""
    kept = [training.kept for training in trainings]
    return median(kept, 3), median([training.process.seconds for training in trainings], 3)


def main(runs: str = "3", python: str = sys.executable) -> None:
    """Trains all in turns and writes the table."""
    done: dict[str, list[Training]] = {}
    installed = run_process("-m", "benchmarks.peers", python=python).output.split("\n")
    with tempfile.TemporaryDirectory() as folder:

        def run(name: str, weights: Path, words: Sequence[str], python: str) -> None:
            started = time.time()
            process = run_process("-m", *words, python=python)
            kept = weights.stat().st_mtime - started
            done.setdefault(name, []).append(Training(kept, process, weights))
            print(f"{name} {kept:.1f} s, {process.seconds:.1f} s", flush=True)

        for seed in map(str, range(int(runs))):
            for name, flags in OURS.items():
                out = Path(folder) / seed / name
                words = ["keras_pendulum.train", "--seed", seed, "--out", str(out), *flags]
                run(name, out / "pendulum_weight.h5", words, sys.executable)
            for package, library in PEERS.items():
                if any(line.startswith(package) for line in installed):
                    weights = Path(folder) / f"{library}{seed}.npz"
                    run(package, weights, ["benchmarks.peers", library, seed, str(weights)], python)
        regrets = {name: [regret(one.weights) for one in each] for name, each in done.items()}

    our_kept, our_process = medians(done[next(iter(OURS))])
    rows: list[dict[str, Any]] = []
    for name, each in done.items():
        kept, process = medians(each)
        rows.append(
            {
                "library": name,
                "seconds until its weights are kept": round(kept, 1),
                "this package's share": round(our_kept / kept, 2),
                "seconds of the whole process": round(process, 1),
                "this package's share of the process": round(our_process / process, 2),
                "mean regret": round(float(np.mean(regrets[name])), 1),
                "worst regret": round(max(regrets[name]), 1),
                "peak memory, MB": round(max(one.process.peak_memory for one in each)),
                "runs": int(runs),
            }
        )
    write("learning", "python -m benchmarks.learning", rows, also=list(filter(None, installed)))


if __name__ == "__main__":
    main(*sys.argv[1:])
