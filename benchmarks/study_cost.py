"""What a study costs beyond its training, and what a second worker gains.

    python -m benchmarks.study_cost [RUNS [EPISODES]]

Makes the same RUNS (8) runs of `reference` on one worker and on two, workers warm, as whole
studies without the command: results are written and read like a user's. 8 runs of 500 episodes take
three minutes on two cores.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

import keras_pendulum as kp
from benchmarks.report import Row, write
from keras_pendulum.arms import Arm
from keras_pendulum.study_folder import StudyFolder
from keras_pendulum.study_loop import Engine, run_all
from keras_pendulum.study_run import train_and_score
from keras_pendulum.worker_processes import WorkerProcesses


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
    write("study_cost", f"python -m benchmarks.study_cost {runs} {episodes}", rows)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
