"""The original's 500 episodes: as first written against the preset `original`.

    python -m benchmarks.original_run [RUNS]

Whole processes that print the 500 lines of the recorded run, in turns; medians. Six minutes for
each of the runs (3).
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from benchmarks.report import Process, median, run_process, write

_DATA = Path(__file__).parents[1] / "tests" / "data"


def preset_original() -> None:
    """The run as a program of its own: the preset from the recorded initial weights."""
    import keras_pendulum as kp

    initial = kp.DQN()
    with np.load(_DATA / "original_run_seed1.npz") as record:
        initial.set_weights([record[f"initial_weight_{i}"] for i in range(8)])
    kp.train_dqn(
        kp.preset("original", seed=1),
        init=initial,
        listeners=[lambda record: print(record.line(), flush=True)],
    )


def identical_lines(process: Process) -> int:
    """How many lines from the first on are those of the recorded run."""
    recorded = (_DATA / "original_run_seed1.log").read_text().splitlines()
    pairs = list(zip(process.output.splitlines(), recorded, strict=True))
    return next((i for i, (ours, theirs) in enumerate(pairs) if ours != theirs), len(pairs))


def main(runs: int = 3) -> None:
    """Runs both in turns and writes the table."""
    programs = {
        "as first written (eager, `model(...)` each step)": ("-m", "benchmarks.as_first_written"),
        "this package, preset `original`": (
            "-c",
            "from benchmarks.original_run import preset_original; preset_original()",
        ),
    }
    done: dict[str, list[Process]] = {name: [] for name in programs}
    for _ in range(runs):
        for name, words in programs.items():
            done[name].append(run_process(*words))
            print(name, round(done[name][-1].seconds, 1), flush=True)
    slowest = median([process.seconds for process in next(iter(done.values()))], 3)
    rows = []
    for name, processes in done.items():
        seconds = median([process.seconds for process in processes], 3)
        rows.append(
            {
                "program": name,
                "seconds": round(seconds, 1),
                "times as fast": round(slowest / seconds, 1),
                "lines as recorded": f"{min(map(identical_lines, processes))} of 500",
                "peak memory, MB": round(max(process.peak_memory for process in processes)),
                "runs": runs,
            }
        )
    write("original_run", "python -m benchmarks.original_run", rows)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
