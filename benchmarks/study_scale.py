"""Where a study's own machinery becomes the limit: a simulated one of many empty runs.

    python -m benchmarks.study_scale [RUNS [WORKERS]]

A run (100 000, over 10 arms) trains nothing: it gives back a result as large as a real one. On
WORKERS (2) worker processes, then on a Dask scheduler with as many workers on this machine (extra
`cluster`). Measured are handing out, writing (flushed to the disk, one file each), finding out that
nothing is missing, and tables with figure.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

import keras_pendulum as kp
from benchmarks.report import Row, write
from keras_pendulum.arms import Arm
from keras_pendulum.cluster import dask_cluster
from keras_pendulum.study_folder import StudyFolder
from keras_pendulum.study_loop import Engine, run_all
from keras_pendulum.study_picture import study_figure
from keras_pendulum.study_result import Job, Result, encode
from keras_pendulum.study_run import Outcome
from keras_pendulum.study_table import make_rows
from keras_pendulum.worker_processes import WorkerProcesses

_ARMS = 10


def empty_run(job: Job) -> Outcome:
    """A result of a real one's size, of nothing."""
    seed = job.config.seed
    returns = [-(40 + (seed * 7919 + i * 104729) % 10_007 / 997) for i in range(100)]
    curve = [round(value / 200, 6) for value in returns[:50]]
    return Outcome(encode(job, Result(-36.677, returns, curve, curve)), 0, 0, 0, "simulated")


def measured(name: str, engine: Engine, runs: int, out: Path) -> Row:
    """A row for a whole study on an engine."""
    arms = [
        Arm(f"arm {i}", kp.preset("reference", updates_per_episode=i + 1)) for i in range(_ARMS)
    ]
    folder = StudyFolder(out / name, arms, runs // _ARMS)
    with folder.opened():
        begun = time.perf_counter()
        for _ in run_all(engine, empty_run, folder.missing()):
            pass
        handed = time.perf_counter()
        for job, outcome, problem in run_all(engine, empty_run, folder.missing()):
            if outcome is None:
                raise RuntimeError(problem)
            folder.keep(job, outcome)
        made = time.perf_counter()
        if folder.missing():
            raise RuntimeError("results are missing")
        checked = time.perf_counter()
    results = folder.results()
    rows = make_rows(arms, results)
    study_figure(rows, results)
    told = time.perf_counter()
    size = sum(path.stat().st_size for path in (out / name).rglob("*.json"))
    row = {
        "engine": name,
        "runs": len(folder.jobs()),
        "handed out and answered (runs/s)": round(runs / (handed - begun)),
        "and written (runs/s)": round(runs / (made - handed)),
        "looked through (s)": round(checked - made, 1),
        "table and figure (s)": round(told - checked, 1),
        "folder (MB)": round(size / 1e6, 1),
        "most memory (MB)": round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3),
    }
    print(row, flush=True)  # 100 000 runs take half an hour
    return row


def main(runs: int = 100_000, workers: int = 2) -> None:
    """Measures on both engines and writes the table."""
    with ExitStack() as stack:
        out = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        executor = stack.enter_context(WorkerProcesses(workers))
        rows = [measured("processes", Engine(executor, workers, lambda: workers), runs, out)]
        card = out / "scheduler.json"
        place = ["--scheduler-file", str(card), "--no-dashboard"]
        commands = [["dask_scheduler", *place, "--port", "0", "--host", "127.0.0.1"]]
        commands += [["dask_worker", *place, "--no-nanny", "--nthreads", "1"]] * workers
        for name, *words in commands:
            process = subprocess.Popen(
                [sys.executable, "-m", f"distributed.cli.{name}", *words], stderr=subprocess.DEVNULL
            )
            stack.callback(process.wait)
            stack.callback(process.terminate)
            while not card.exists() or not card.read_text().endswith("}"):
                time.sleep(0.1)
        address = json.loads(card.read_text())["address"]
        versions = StudyFolder(out, [], 0).versions
        engine = stack.enter_context(dask_cluster(address, versions))
        rows.append(measured("dask", engine, runs, out))
    write("study_scale", f"python -m benchmarks.study_scale {runs} {workers}", rows)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
