"""What checkpoints cost the default run.

    python -m benchmarks.saving [RUNS]

A run of `reference` waits for each of its checkpoints, and goes on more slowly while a thread
writes it. Both are measured within the run, because whole runs differ by more: the wait itself, and
how much longer the episode after a checkpoint takes than those further from one. Medians of a run's
checkpoints, and of the runs, each a process of its own (5, a minute and a half).
"""

from __future__ import annotations

import json
import sys
import tempfile
import time

import numpy as np

import keras_pendulum as kp
from benchmarks.report import median, run_process, write
from keras_pendulum.checkpoint import CheckpointWriter
from keras_pendulum.run import Run


def one_run() -> None:
    """Trains and prints what it measured, as JSON."""
    config = kp.preset("reference")
    waits = []
    save = CheckpointWriter.save

    def timed(writer: CheckpointWriter, run: Run) -> None:
        started = time.perf_counter()
        save(writer, run)
        waits.append(time.perf_counter() - started)

    CheckpointWriter.save = timed  # type: ignore[method-assign, assignment]
    started = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        history = kp.train_dqn(config, folder).history
    training = time.perf_counter() - started
    every = config.save_every
    first = (config.learning_starts // every + 1) * every + 1  # with updates, after a checkpoint
    seconds = np.array([record.seconds for record in history[first:]])
    rows = seconds[: len(seconds) // every * every].reshape(-1, every)
    slower = rows[:, 0] - np.median(rows[:, every // 2 :], axis=1)
    measured = {
        "wait": float(np.median(waits)),
        "slower": float(np.median(slower)),
        "count": len(waits),
        "training": training,
    }
    print(json.dumps(measured))


def main(runs: int = 5) -> None:
    """Runs them and writes the table."""
    done = []
    for _ in range(runs):
        process = run_process("-c", "from benchmarks.saving import one_run; one_run()")
        done.append({**json.loads(process.output), "process": process.seconds})
        print(done[-1], flush=True)
    cost = [(run["wait"] + run["slower"]) * run["count"] for run in done]
    row = {
        "checkpoints": done[0]["count"],
        "the run waits for one, ms": median([1000 * run["wait"] for run in done]),
        "the next episode takes longer, ms": median([1000 * run["slower"] for run in done]),
        "in all, s": median(cost, 2),
        "% of the training": median(
            [100 * seconds / run["training"] for seconds, run in zip(cost, done, strict=True)]
        ),
        "% of the process": median(
            [100 * seconds / run["process"] for seconds, run in zip(cost, done, strict=True)]
        ),
        "runs": runs,
    }
    write("saving", "python -m benchmarks.saving", [row])


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
