"""The cost of a study beyond its training, and the gain of a second worker.

    python -m benchmarks.speed.study_cost [ROUNDS [RUNS [EPISODES]]]

Makes the same RUNS (4) runs of `reference` on one worker and on two, as whole studies without the
command: results are written and read as for a user. The workers have made a run before. Both take
turns, ROUNDS (5) times, because a shared machine is faster in one minute than in another; the table
has the medians. With 500 episodes that takes twelve minutes on two cores. For comparison, two
processes multiply matrices of the size of an update: no study can be more efficient than that.
"""

from __future__ import annotations

import multiprocessing
import statistics
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor, wait
from pathlib import Path

import keras_pendulum as kp
from benchmarks.result_files import Row, write
from benchmarks.speed.processes import median
from keras_pendulum.study.arms import Arm
from keras_pendulum.study.dask_workers import local_workers
from keras_pendulum.study.job import train_and_score
from keras_pendulum.study.results_folder import ResultsFolder
from keras_pendulum.study.runner import run_all
from keras_pendulum.tensorflow_setup import use_one_thread


def multiply(times: int) -> None:
    """Multiplies matrices of the widest layer's size."""
    import numpy as np

    features, kernel = np.ones((32, 512), np.float32), np.ones((512, 256), np.float32)
    for _ in range(times):
        features @ kernel


def machine_efficiency(workers: int) -> float:
    """Returns the speed of each of several multiplying processes, relative to one alone."""
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, spawn, use_one_thread) as executor:

        def seconds(processes: int) -> float:
            started = time.perf_counter()
            wait([executor.submit(multiply, 20_000) for _ in range(processes)])
            return time.perf_counter() - started

        seconds(workers)  # starts the processes
        return statistics.median(seconds(1) / seconds(workers) for _ in range(5))


def measure(workers: int, runs: int, episodes: int) -> Row:
    """Returns a row for a study on so many workers."""
    warm = Arm("warm", kp.preset("reference", episodes=42))
    arm = Arm("reference", kp.preset("reference", episodes=episodes))
    started = time.perf_counter()
    with local_workers(workers) as client, tempfile.TemporaryDirectory() as out:
        client.wait_for_workers(workers)
        warm_jobs = ResultsFolder(Path(out) / "warm", [warm], workers).jobs()
        replies = [finished.reply for finished in run_all(client, train_and_score, warm_jobs)]
        useful = sum(reply.training + reply.evaluation for reply in replies if reply)
        start = time.perf_counter() - started - useful / workers
        folder = ResultsFolder(Path(out) / "study", [arm], runs)
        training = evaluation = in_worker = 0.0
        with folder.create_and_lock():
            begun = time.perf_counter()
            for job, reply, problem in run_all(client, train_and_score, folder.missing_jobs()):
                if reply is None:
                    raise RuntimeError(problem)
                folder.save(job, reply)
                training += reply.training
                evaluation += reply.evaluation
                in_worker += reply.total
            seconds = time.perf_counter() - begun
    return {
        "workers": workers,
        "runs": runs,
        "seconds": seconds,
        "runs per core-hour": 3600 * runs / (seconds * workers),
        "efficiency": 0.0,  # relative to one worker in the same round
        "efficiency of matrix products": machine_efficiency(workers),
        "training (s per run)": training / runs,
        "evaluation (s per run)": evaluation / runs,
        "overhead (s per run)": (seconds * workers - training - evaluation) / runs,
        "overhead in the worker (s per run)": (in_worker - training - evaluation) / runs,
        "start of a worker (s, once)": start,
    }


def main(rounds: int = 5, runs: int = 4, episodes: int = 500) -> None:
    """Measures with one worker and with two, in turns, and writes the table."""
    pairs = [[measure(workers, runs, episodes) for workers in (1, 2)] for _ in range(rounds)]
    for alone, both in pairs:
        alone["efficiency"], both["efficiency"] = 1.0, alone["seconds"] / (2 * both["seconds"])
    rows: list[Row] = [
        {name: median([row[name] for row in column], 3) for name in column[0]}
        for column in zip(*pairs, strict=True)
    ]
    write("study_cost", f"python -m benchmarks.speed.study_cost {rounds} {runs} {episodes}", rows)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
