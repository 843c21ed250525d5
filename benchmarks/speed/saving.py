"""Measures what checkpoints cost the default run.

    python -m benchmarks.speed.saving [RUNS]

A run of `reference` waits while its state is encoded, and is slower while a thread writes the file.
Both are measured within the run, because whole runs differ by more: the wait, and the time of the
episode after a checkpoint minus that of later episodes. The table gives medians over a run's
checkpoints and over the runs. Each run is a process (5 runs, a minute and a half).
"""

from __future__ import annotations

import json
import sys
import tempfile
import time

import numpy as np

import keras_pendulum as kp
from benchmarks.result_files import write
from benchmarks.speed.processes import median, run_process
from keras_pendulum.train.checkpoint import CheckpointWriter
from keras_pendulum.train.run import Run


def measure_run() -> None:
    """Trains and prints the measured times as JSON."""
    config = kp.preset("reference")
    waits = []
    save = CheckpointWriter.save

    def timed_save(writer: CheckpointWriter, run: Run) -> None:
        started = time.perf_counter()
        save(writer, run)
        waits.append(time.perf_counter() - started)

    CheckpointWriter.save = timed_save  # type: ignore[method-assign, assignment]
    started = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        history = kp.train_dqn(config, folder).history
    training = time.perf_counter() - started
    every = config.save_every
    # From the first episode with updates that follows a checkpoint.
    first = (config.warmup_episodes // every + 1) * every + 1
    seconds = np.array([record.seconds for record in history[first:]])
    rows = seconds[: len(seconds) // every * every].reshape(-1, every)
    slowdowns = rows[:, 0] - np.median(rows[:, every // 2 :], axis=1)
    measured = {
        "wait": float(np.median(waits)),
        "slowdown": float(np.median(slowdowns)),
        "checkpoints": len(waits),
        "training": training,
    }
    print(json.dumps(measured))


def main(count: int = 5) -> None:
    """Measures `count` runs and writes the table."""
    runs = []
    for _ in range(count):
        program = "from benchmarks.speed.saving import measure_run; measure_run()"
        process = run_process("-c", program)
        runs.append({**json.loads(process.output), "process": process.seconds})
        print(runs[-1], flush=True)
    costs = [(run["wait"] + run["slowdown"]) * run["checkpoints"] for run in runs]  # s
    row = {
        "checkpoints": runs[0]["checkpoints"],
        "wait for one, ms": median([1000 * run["wait"] for run in runs]),
        "slowdown of the next episode, ms": median([1000 * run["slowdown"] for run in runs]),
        "all checkpoints, s": median(costs, 2),
        "% of the training": median(
            [100 * cost / run["training"] for cost, run in zip(costs, runs, strict=True)]
        ),
        "% of the process": median(
            [100 * cost / run["process"] for cost, run in zip(costs, runs, strict=True)]
        ),
        "runs": count,
    }
    write("saving", "python -m benchmarks.speed.saving", [row])


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
