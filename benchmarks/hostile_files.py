"""What it costs to refuse files that were made to cost time or memory.

    python -m benchmarks.hostile_files

The files of tests/test_hostile_files.py in both layouts, and one with a million names; for each the
seconds that `load_weights` takes to refuse it and by how much the process has then grown. Needs the
extra `test`; a minute.
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
MILLION = "a million names"


def memory() -> float:
    """The most that this process has held so far, MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6


def a_million_names(file: h5py.File, kernel: str) -> None:
    """More names than any network has, none of them leading anywhere."""
    group = file.create_group("names")
    for i in range(1_000_000):
        group[str(i)] = h5py.SoftLink("/nowhere")


def refused(kind: str, path: Path) -> Row:
    """A line of the table. Raises AssertionError when the file is not refused."""
    before = memory()
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
        "memory, MB": round(memory() - before, 1),
    }


def make(kind: str, layout: str, path: Path) -> None:
    """Makes one of the files."""
    from test_hostile_files import HOSTILE, hostile_file

    hostile_file(path, a_million_names if kind == MILLION else HOSTILE[kind][0], layout)


def main() -> None:
    """Makes the files, measures, writes the table."""
    sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
    from test_hostile_files import HOSTILE, KERNEL

    with tempfile.TemporaryDirectory() as folder:
        files = {
            (kind, layout): Path(folder) / f"{i}-{layout}.h5"
            for i, kind in enumerate((*HOSTILE, MILLION))
            for layout in KERNEL
        }
        # In a process of its own, whose memory does not count.
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            pool.starmap(make, [(*key, path) for key, path in files.items()])
        kp.load_weights(kp.find_weights("reference"))  # everything is imported by then
        rows = [refused(", ".join(key), path) for key, path in files.items()]
    write("hostile_files", "python -m benchmarks.hostile_files", rows)


if __name__ == "__main__":
    main()
