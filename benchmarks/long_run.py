"""Memory and speed of a run of 5000 episodes.

    python -m benchmarks.long_run [EPISODES]

Trains the preset `reference` that long, with all that the command keeps on disk and a checkpoint
every 10 episodes, and watches the process and its folder: memory, seconds an episode, open files,
files in the folder and the checkpoint's size, early (the 500 episodes after ε has reached its
floor) and at the end. Three minutes; 20000 episodes take ten.
"""

from __future__ import annotations

import os
import resource
import statistics
import sys
import tempfile
from pathlib import Path

import keras_pendulum as kp
from benchmarks.report import write
from keras_pendulum.episodes import EpisodeRecord

WINDOW = 500  # episodes


def resident() -> float:
    """Memory of this process now, MB."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def main(episodes: int = 5000) -> None:
    """Trains, watching, and writes the table."""
    memory: list[float] = []
    seconds: list[float] = []
    left: list[tuple[int, int, float]] = []  # open files, files in the folder, the checkpoint's MB

    def watch(record: EpisodeRecord) -> None:
        memory.append(resident())
        seconds.append(record.seconds)
        opened, kept = (len(list(Path(folder).iterdir())) for folder in ("/proc/self/fd", run))
        left.append((opened, kept, (run / "pendulum_weight.h5").stat().st_size / 1e6))

    config = kp.preset("reference", episodes=episodes)
    with tempfile.TemporaryDirectory() as folder:
        run = Path(folder) / "run"
        kp.train_dqn(config, run, listeners=[watch])
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6
    rows = []
    for name, first in (("early", WINDOW), ("at the end", episodes - WINDOW)):
        window = slice(first, first + WINDOW)
        rows.append(
            {
                "episodes": f"{first} to {first + WINDOW - 1}, {name}",
                "resident memory, MB": round(statistics.median(memory[window])),
                "ms an episode": round(1e3 * statistics.median(seconds[window]), 2),
                "open files": max(opened for opened, _, _ in left[window]),
                "files in the folder": max(files for _, files, _ in left[window]),
                "checkpoint, MB": round(left[window][-1][2], 2),
            }
        )
    peak_row = dict.fromkeys(rows[0], "")
    rows.append({**peak_row, "episodes": "all", "resident memory, MB": f"peak {peak:.0f}"})
    write("long_run", f"python -m benchmarks.long_run {episodes}", rows)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
