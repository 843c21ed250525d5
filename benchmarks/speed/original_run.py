"""The original's 500 episodes: the program as first written and the preset `original`.

    python -m benchmarks.speed.original_run [RUNS]

Measures whole processes that print the 500 lines of the recorded run: examples/original.py and this
package, in turns (3 runs of each); the table has medians. It takes six minutes.
"""

from __future__ import annotations

import sys

from benchmarks.recorded_runs.pendulum import initial_network
from benchmarks.recorded_runs.recording import printed_lines
from benchmarks.result_files import ROOT, write
from benchmarks.speed.processes import Process, in_turns, median, run_process
from keras_pendulum.tensorflow_setup import set_environment_defaults

PROGRAMS = {
    "as first written (eager, `model(...)` each step)": (str(ROOT / "examples" / "original.py"),),
    "this package, preset `original`": (
        "-c",
        "from benchmarks.speed.original_run import train_original; train_original()",
    ),
}


def train_original() -> None:
    """Trains the preset from the recorded initial weights and prints its lines."""
    import keras_pendulum as kp

    kp.train_dqn(
        kp.preset("original", seed=1),
        init=initial_network("original"),
        listeners=[lambda record: print(record.line(), flush=True)],
    )


def identical_lines(process: Process) -> int:
    """Returns how many lines are those of the recorded run, from the first on."""
    recorded = printed_lines("original_run_seed1")
    pairs = list(zip(process.output.splitlines(), recorded, strict=True))
    differences = (i for i, (printed, expected) in enumerate(pairs) if printed != expected)
    return next(differences, len(pairs))


def main(runs: int = 3) -> None:
    """Makes all runs and writes the table."""
    set_environment_defaults()  # also for examples/original.py, so that both round alike

    def run(name: str, _: int) -> Process:
        process = run_process(*PROGRAMS[name])
        print(name, round(process.seconds, 1), flush=True)
        return process

    processes = in_turns(PROGRAMS, run, runs)
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
    write("original_run", "python -m benchmarks.speed.original_run", rows)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
