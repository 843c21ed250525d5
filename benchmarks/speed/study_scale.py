"""The limits of a study's own machinery: a simulated study of many empty runs.

    python -m benchmarks.speed.study_scale [RUNS [WORKERS]]

An empty run trains nothing and returns a result as large as a real one. RUNS (8000, over 10 arms)
are handed out to WORKERS (8) worker processes of this machine, first without writing the results,
then with (one file each, flushed to the disk). Then the folder is searched for missing runs, and
the table and the figure are made. One minute on two cores.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from pathlib import Path

import keras_pendulum as kp
from benchmarks.result_files import write
from benchmarks.speed.processes import PeakMemory
from keras_pendulum.study.arms import Arm
from keras_pendulum.study.dask_workers import local_workers
from keras_pendulum.study.figure import draw_study
from keras_pendulum.study.job import Job, Reply, RunResult, encode
from keras_pendulum.study.results_folder import ResultsFolder
from keras_pendulum.study.runner import run_all
from keras_pendulum.study.table import make_rows

_ARMS = 10


def empty_run(job: Job) -> Reply:
    """Returns a result of the size of a real one, without training."""
    seed = job.config.seed
    returns = [-(40 + (seed * 7919 + i * 104729) % 10_007 / 997) for i in range(100)]
    curve = [round(value / 200, 6) for value in returns[:50]]
    result = RunResult(-36.677, returns, curve, curve, returns[:10])
    return Reply(encode(job, result), 0, 0, 0, "simulated")


def main(runs: int = 8000, workers: int = 8) -> None:
    """Measures a whole study and writes the table."""
    arms = [
        Arm(f"arm {i}", kp.preset("reference", updates_per_episode=i + 1)) for i in range(_ARMS)
    ]
    with tempfile.TemporaryDirectory() as out, PeakMemory(os.getpid()) as peak:
        folder = ResultsFolder(Path(out) / "study", arms, runs // _ARMS)
        with local_workers(workers) as client, folder.create_and_lock():
            client.wait_for_workers(workers)
            jobs = folder.missing_jobs()
            started = time.perf_counter()
            for _ in run_all(client, empty_run, jobs):
                pass
            answered = time.perf_counter()
            for job, reply, problem in run_all(client, empty_run, jobs):
                if reply is None:
                    raise RuntimeError(problem)
                folder.save(job, reply)
            written = time.perf_counter()
        searching = time.perf_counter()
        if folder.missing_jobs():
            raise RuntimeError("results are missing")
        searched = time.perf_counter()
        results = folder.results()
        draw_study(make_rows(arms, results), results)
        drawn = time.perf_counter()
        size = sum(path.stat().st_size for path in folder.path.rglob("*.json"))
    row = {
        "runs": len(jobs),
        "workers": workers,
        "answered (runs/s)": round(len(jobs) / (answered - started)),
        "answered and written (runs/s)": round(len(jobs) / (written - answered)),
        "searched for missing runs (s)": round(searched - searching, 1),
        "table and figure (s)": round(drawn - searched, 1),
        "folder (MB)": round(size / 1e6, 1),
        "peak memory (MB)": round(peak.megabytes),
    }
    write("study_scale", f"python -m benchmarks.speed.study_scale {runs} {workers}", [row])


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
