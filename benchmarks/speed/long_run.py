"""Memory, speed and files of a long run.

    python -m benchmarks.speed.long_run [EPISODES]

Trains the preset `reference` for 5000 episodes in a run folder, with a checkpoint every 10. After
each episode it measures the resident memory, the time of the episode, the open files, the files in
the folder without its lock, and the size of the checkpoint. The table compares episodes 500 to 999,
when ε has reached its minimum, with the last 500. It takes two minutes, and 20000 episodes take
seven.
"""

from __future__ import annotations

import os
import statistics
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

import psutil

import keras_pendulum as kp
from benchmarks.result_files import write
from benchmarks.speed.processes import PeakMemory, resident_memory
from keras_pendulum.history import EpisodeRecord
from keras_pendulum.storage.folder_lock import LOCK_FILE

WINDOW = 500  # episodes


class Measurement(NamedTuple):
    """The state of the process and of its run folder after an episode."""

    memory: float  # MB, resident
    seconds: float  # of the episode
    open_files: int  # with pipes and sockets; on Windows all handles
    files: int  # in the folder, without its lock
    checkpoint: float  # MB


def measure(record: EpisodeRecord, folder: Path) -> Measurement:
    """Returns the measurement after an episode."""
    process = psutil.Process()
    return Measurement(
        resident_memory(process),
        record.seconds,
        process.num_handles() if sys.platform == "win32" else process.num_fds(),
        len({file.name for file in folder.iterdir()} - {LOCK_FILE}),
        (folder / "pendulum_weight.h5").stat().st_size / 1e6,
    )


def main(episodes: int = 5000) -> None:
    """Trains, measures and writes the table."""
    measurements: list[Measurement] = []
    config = kp.preset("reference", episodes=episodes)
    with tempfile.TemporaryDirectory() as parent, PeakMemory(os.getpid()) as peak:
        folder = Path(parent) / "run"
        kp.train_dqn(
            config,
            folder,
            listeners=[lambda record: measurements.append(measure(record, folder))],
        )
    rows = []
    for name, first in (("early", WINDOW), ("at the end", episodes - WINDOW)):
        window = measurements[first : first + WINDOW]
        rows.append(
            {
                "episodes": f"{first} to {first + WINDOW - 1}, {name}",
                "resident memory, MB": round(statistics.median(each.memory for each in window)),
                "ms per episode": round(
                    1e3 * statistics.median(each.seconds for each in window), 2
                ),
                "open files": max(each.open_files for each in window),
                "files in the folder": max(each.files for each in window),
                "checkpoint, MB": round(window[-1].checkpoint, 2),
            }
        )
    peak_row = dict.fromkeys(rows[0], "")
    rows.append(
        {**peak_row, "episodes": "all", "resident memory, MB": f"peak {peak.megabytes:.0f}"}
    )
    write("long_run", f"python -m benchmarks.speed.long_run {episodes}", rows)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
