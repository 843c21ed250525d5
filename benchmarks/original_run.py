"""The original's 500 episodes: the program as first written and the preset `original`.

    python -m benchmarks.original_run [RUNS]

Measures whole processes that print the 500 lines of the recorded run: examples/original.py and this
package, in turns (3 runs of each); the table has medians. It takes nine minutes.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from benchmarks.report import Process, median, run_process, write
from keras_pendulum.tensorflow_setup import set_environment_defaults

_ROOT = Path(__file__).parents[1]
_DATA = _ROOT / "tests" / "data"
PROGRAMS = {
    "as first written (eager, `model(...)` each step)": (str(_ROOT / "examples" / "original.py"),),
    "this package, preset `original`": (
        "-c",
        "from benchmarks.original_run import train_original; train_original()",
    ),
}


def train_original() -> None:
    """Trains the preset from the recorded initial weights and prints its lines."""
    import keras_pendulum as kp

    initial = kp.DQN()
    with np.load(_DATA / "original_run_seed1.npz") as recorded:
        initial.set_weights([recorded[f"initial_weight_{i}"] for i in range(8)])
    kp.train_dqn(
        kp.preset("original", seed=1),
        init=initial,
        listeners=[lambda record: print(record.line(), flush=True)],
    )


def identical_lines(process: Process) -> int:
    """Returns how many lines are those of the recorded run, from the first on."""
    recorded = (_DATA / "original_run_seed1.log").read_text("utf-8").splitlines()
    pairs = list(zip(process.output.splitlines(), recorded, strict=True))
    differences = (i for i, (printed, expected) in enumerate(pairs) if printed != expected)
    return next(differences, len(pairs))


def main(runs: int = 3) -> None:
    """Makes all runs and writes the table."""
    set_environment_defaults()  # also for examples/original.py, so that both round alike
    processes: dict[str, list[Process]] = {name: [] for name in PROGRAMS}
    for _ in range(runs):
        for name, arguments in PROGRAMS.items():
            processes[name].append(run_process(*arguments))
            print(name, round(processes[name][-1].seconds, 1), flush=True)
    seconds = {
        name: median([process.seconds for process in measured], 3)
        for name, measured in processes.items()
    }
    rows = [
        {
            "program": name,
            "seconds": round(seconds[name], 1),
            "times as fast": round(max(seconds.values()) / seconds[name], 1),
            "lines as recorded": f"{min(map(identical_lines, measured))} of 500",
            "peak memory, MB": round(max(process.peak_memory for process in measured)),
            "runs": runs,
        }
        for name, measured in processes.items()
    ]
    write("original_run", "python -m benchmarks.original_run", rows)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
