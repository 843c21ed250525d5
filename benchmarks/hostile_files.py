"""Measures time and memory to refuse files that were made to cost time or memory.

    python -m benchmarks.hostile_files

Loads the files of tests/storage/test_h5_validation.py in both layouts, and a file with a million
names. The table gives the slowest of several calls of `load_weights`, and the growth of the
process. Needs the extra `test`; a minute.
"""

from __future__ import annotations

import multiprocessing
import resource
import sys
import tempfile
import time
from pathlib import Path

import h5py

import keras_pendulum as kp
from benchmarks.report import Row, write

ATTEMPTS = 5
MILLION_NAMES = "a million names"


def peak_memory() -> float:
    """Returns the peak memory of this process in MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6


def add_million_names(file: h5py.File, kernel: str) -> None:
    """Adds a million links that lead nowhere."""
    group = file.create_group("names")
    for i in range(1_000_000):
        group[str(i)] = h5py.SoftLink("/nowhere")


def measure(kind: str, path: Path) -> Row:
    """Returns a row of the table. Raises AssertionError when the file is not refused."""
    memory_before = peak_memory()
    times = []
    for _ in range(ATTEMPTS):
        started = time.perf_counter()
        try:
            kp.load_weights(path)
        except kp.WeightsError:
            times.append(time.perf_counter() - started)
    assert len(times) == ATTEMPTS, kind
    return {
        "file": kind,
        "MB": round(path.stat().st_size / 1e6, 2),
        "slowest, ms": round(max(times) * 1e3, 1),
        "memory, MB": round(peak_memory() - memory_before, 1),
    }


def make_file(kind: str, layout: str, path: Path) -> None:
    """Writes a hostile file."""
    from test_h5_validation import HOSTILE, hostile_file

    hostile_file(path, add_million_names if kind == MILLION_NAMES else HOSTILE[kind][0], layout)


def main() -> None:
    """Writes the files, measures them and writes the table."""
    tests = Path(__file__).parents[1] / "tests"
    sys.path[:0] = [str(tests), str(tests / "storage")]
    from test_h5_validation import HOSTILE, KERNEL

    with tempfile.TemporaryDirectory() as folder:
        files = {
            (kind, layout): Path(folder) / f"{i}-{layout}.h5"
            for i, kind in enumerate((*HOSTILE, MILLION_NAMES))
            for layout in KERNEL
        }
        # In another process, so that its memory does not count.
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            pool.starmap(make_file, [(*key, path) for key, path in files.items()])
        kp.load_weights(kp.find_weights("reference"))  # imports everything before the measurement
        rows = [measure(", ".join(key), path) for key, path in files.items()]
    write("hostile_files", "python -m benchmarks.hostile_files", rows)


if __name__ == "__main__":
    main()
