"""The import of TensorFlow and Keras with and without garbage collection.

    python -m benchmarks.speed.import_time [RUNS]

Measures whole processes that import `keras_pendulum.DQN`, and with it TensorFlow and Keras. The
package pauses garbage collection for that import (`tensorflow_setup.fast_import`); the second
program imports the same without the pause. The processes run in turns, 5 of each; the table has
their medians. It takes a minute.
"""

from __future__ import annotations

import sys

from benchmarks.result_files import write
from benchmarks.speed.processes import in_turns, median, run_process

PROGRAMS = {
    "paused": "import keras_pendulum; keras_pendulum.DQN",
    "not paused": "import contextlib, keras_pendulum; "
    "keras_pendulum.fast_import = contextlib.nullcontext; keras_pendulum.DQN",
}


def main(runs: int = 5) -> None:
    """Runs the processes and writes the table."""
    run_process("-c", PROGRAMS["paused"])  # reads the files from the disk
    processes = in_turns(PROGRAMS, lambda name, _: run_process("-c", PROGRAMS[name]), runs)
    rows = [
        {
            "garbage collection": name,
            "seconds of the whole process": median([each.seconds for each in measured], 2),
            "peak memory, MB": round(median([each.peak_memory for each in measured])),
            "runs": runs,
        }
        for name, measured in processes.items()
    ]
    write("import_time", "python -m benchmarks.speed.import_time", rows)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
