"""How long the task of `reference` takes here and in other libraries, and how well it ends.

    python -m benchmarks.learning [RUNS]

Whole processes in turns, one for each of the training seeds 0, 1, … (3 runs), all with the numbers
of the preset `reference`; medians. This package's is the command `keras_pendulum.train` with all it
does: checkpoints, picture, evaluation. The others only train and keep their weights. A library that
is not installed (extra `bench`) is left out.
"""

from __future__ import annotations

import importlib.util
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.report import Process, median, run_process, write

PEERS = {"Stable-Baselines3": ("sb3", "stable_baselines3"), "sbx": ("sbx", "sbx")}


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


def main(runs: int = 3) -> None:
    """Trains all in turns and writes the table."""
    done: dict[str, list[tuple[Process, Path]]] = {}
    with tempfile.TemporaryDirectory() as folder:

        def run(name: str, weights: Path, words: Sequence[str]) -> None:
            process = run_process("-m", *words)
            done.setdefault(name, []).append((process, weights))
            print(f"{name} {process.seconds:.1f} s", flush=True)

        for seed in map(str, range(runs)):
            out = Path(folder) / seed
            run(
                "this package",
                out / "pendulum_weight.h5",
                ["keras_pendulum.train", "--seed", seed, "--out", str(out)],
            )
            for name, (library, module) in PEERS.items():
                if importlib.util.find_spec(module):
                    weights = Path(folder) / f"{library}{seed}.npz"
                    run(name, weights, ["benchmarks.peers", library, seed, str(weights)])
        regrets = {name: [regret(weights) for _, weights in each] for name, each in done.items()}

    ours = median([process.seconds for process, _ in done["this package"]], 3)
    rows: list[dict[str, Any]] = []
    for name, each in done.items():
        seconds = median([process.seconds for process, _ in each], 3)
        rows.append(
            {
                "library": name,
                "seconds": round(seconds, 1),
                "this package's share of that": round(ours / seconds, 2),
                "mean regret": round(float(np.mean(regrets[name])), 1),
                "worst regret": round(max(regrets[name]), 1),
                "peak memory, MB": round(max(process.peak_memory for process, _ in each)),
                "runs": runs,
            }
        )
    write("learning", "python -m benchmarks.learning", rows, peers=True)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
