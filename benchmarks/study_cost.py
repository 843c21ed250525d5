"""What a study costs beyond its training, and what a second worker gains.

    python -m benchmarks.study_cost [RUNS [EPISODES]]

Makes the same RUNS (8) runs of `reference` on one worker and on two, workers warm, as whole
studies without the command: results are written and read like a user's. 8 runs of 500 episodes take
three minutes on two cores. Beside it stands what the machine itself gives to two processes that do
nothing but multiply matrices of an update's size: where its cores share what they compute with,
no study can do better.
"""

from __future__ import annotations

import statistics
import sys
import tempfile
import time
from concurrent.futures import wait
from pathlib import Path

import keras_pendulum as kp
from benchmarks.report import Row, write
from keras_pendulum.arms import Arm
from keras_pendulum.study_folder import StudyFolder
from keras_pendulum.study_loop import Engine, run_all
from keras_pendulum.study_run import train_and_score
from keras_pendulum.worker_processes import WorkerProcesses


def multiply(times: int) -> None:
    """Matrix products of the widest layer's size, on one thread."""
    import numpy as np

    features, kernel = np.ones((32, 512), np.float32), np.ones((512, 256), np.float32)
    for _ in range(times):
        features @ kernel


def machine_efficiency(workers: int) -> float:
    """How fast each of so many processes multiplies beside the others, against one alone."""
    with WorkerProcesses(workers) as executor:

        def seconds(processes: int) -> float:
            started = time.perf_counter()
            wait([executor.submit(multiply, 20_000) for _ in range(processes)])
            return time.perf_counter() - started

        seconds(workers)  # starts them
        return statistics.median(seconds(1) / seconds(workers) for _ in range(5))


def measured(workers: int, runs: int, episodes: int) -> Row:
    """A row for a study on so many workers, each of which has made a run before."""
    warm = Arm("warm", kp.preset("reference", episodes=42))
    arm = Arm("reference", kp.preset("reference", episodes=episodes))
    with WorkerProcesses(workers) as executor, tempfile.TemporaryDirectory() as out:
        engine = Engine(executor, workers, lambda: workers)
        first = StudyFolder(Path(out) / "warm", [warm], workers)
        started = time.perf_counter()
        outcomes = [ended.outcome for ended in run_all(engine, train_and_score, first.tasks())]
        useful = sum(each.training + each.evaluation for each in outcomes if each)
        start = time.perf_counter() - started - useful / workers
        folder = StudyFolder(Path(out) / "study", [arm], runs)
        training = evaluation = inside = 0.0
        with folder.opened():
            begun = time.perf_counter()
            for task, outcome, problem in run_all(engine, train_and_score, folder.missing()):
                if outcome is None:
                    raise RuntimeError(problem)
                folder.keep(task, outcome)
                training += outcome.training
                evaluation += outcome.evaluation
                inside += outcome.total
            seconds = time.perf_counter() - begun
    return {
        "workers": workers,
        "runs": runs,
        "seconds": round(seconds, 1),
        "seeds per core-hour": round(3600 * runs / (seconds * workers)),
        "efficiency": "",
        "of bare matrix products": "",
        "training (s a run)": round(training / runs, 2),
        "evaluation (s a run)": round(evaluation / runs, 2),
        "all else (s a run)": round((seconds * workers - training - evaluation) / runs, 3),
        "of it in the worker (s a run)": round((inside - training - evaluation) / runs, 3),
        "a worker's start (s, once)": round(start, 1),
    }


def main(runs: int = 8, episodes: int = 500) -> None:
    """Measures with one worker and with two, and writes the table."""
    rows = [measured(workers, runs, episodes) for workers in (1, 2)]
    for row in rows:
        row["efficiency"] = round(rows[0]["seconds"] / (row["workers"] * row["seconds"]), 2)
        row["of bare matrix products"] = round(machine_efficiency(row["workers"]), 2)
    write("study_cost", f"python -m benchmarks.study_cost {runs} {episodes}", rows)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
