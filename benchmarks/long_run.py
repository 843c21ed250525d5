"""Memory and speed of a run of 5000 episodes.

    python -m benchmarks.long_run [EPISODES]

Trains the preset `reference` that long, with all that the command keeps on disk, and watches the
process: memory and seconds an episode, early (the 500 episodes after ε has reached its floor) and
at the end. Three minutes.
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

    def watch(record: EpisodeRecord) -> None:
        memory.append(resident())
        seconds.append(record.seconds)

    config = kp.preset("reference", episodes=episodes)
    with tempfile.TemporaryDirectory() as folder:
        kp.train_dqn(config, Path(folder) / "run", listeners=[watch])
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6
    rows = []
    for name, first in (("early", WINDOW), ("at the end", episodes - WINDOW)):
        window = slice(first, first + WINDOW)
        rows.append(
            {
                "episodes": f"{first} to {first + WINDOW - 1}, {name}",
                "resident memory, MB": round(statistics.median(memory[window])),
                "ms an episode": round(1e3 * statistics.median(seconds[window]), 2),
            }
        )
    rows.append({"episodes": "all", "resident memory, MB": f"peak {peak:.0f}", "ms an episode": ""})
    write("long_run", "python -m benchmarks.long_run", rows)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
