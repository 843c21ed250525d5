"""What a study costs beyond its training, and what a second worker gains.

    python -m benchmarks.study_cost [ROUNDS [RUNS [EPISODES]]]

Makes the same RUNS (4) runs of `reference` on one worker and on two, workers warm, as whole
studies without the command: results are written and read like a user's. In turns, ROUNDS (5)
times, because a shared machine is faster in one minute than in another; medians. With 500 episodes
that takes eight minutes on two cores. Beside it stands what the machine itself gives to two
processes that do nothing but multiply matrices of an update's size: where its cores share what they
compute with, no study can do better.
"""

from __future__ import annotations

import statistics
import sys
import tempfile
import time
from concurrent.futures import wait
from pathlib import Path

import keras_pendulum as kp
from benchmarks.report import Row, median, write
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
        outcomes = [ended.outcome for ended in run_all(engine, train_and_score, first.jobs())]
        useful = sum(each.training + each.evaluation for each in outcomes if each)
        start = time.perf_counter() - started - useful / workers
        folder = StudyFolder(Path(out) / "study", [arm], runs)
        training = evaluation = inside = 0.0
        with folder.opened():
            begun = time.perf_counter()
            for job, outcome, problem in run_all(engine, train_and_score, folder.missing()):
                if outcome is None:
                    raise RuntimeError(problem)
                folder.keep(job, outcome)
                training += outcome.training
                evaluation += outcome.evaluation
                inside += outcome.total
            seconds = time.perf_counter() - begun
    return {
        "workers": workers,
        "runs": runs,
        "seconds": seconds,
        "seeds per core-hour": 3600 * runs / (seconds * workers),
        "efficiency": 0.0,  # against one worker in the same minute
        "of bare matrix products": machine_efficiency(workers),
        "training (s a run)": training / runs,
        "evaluation (s a run)": evaluation / runs,
        "all else (s a run)": (seconds * workers - training - evaluation) / runs,
        "of it in the worker (s a run)": (inside - training - evaluation) / runs,
        "a worker's start (s, once)": start,
    }


def main(rounds: int = 5, runs: int = 4, episodes: int = 500) -> None:
    """Measures with one worker and with two, in turns, and writes the table."""
    pairs = [[measured(workers, runs, episodes) for workers in (1, 2)] for _ in range(rounds)]
    for alone, both in pairs:
        alone["efficiency"], both["efficiency"] = 1.0, alone["seconds"] / (2 * both["seconds"])
    rows: list[Row] = [
        {name: median([row[name] for row in column], 3) for name in column[0]}
        for column in zip(*pairs, strict=True)
    ]
    write("study_cost", f"python -m benchmarks.study_cost {rounds} {runs} {episodes}", rows)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
