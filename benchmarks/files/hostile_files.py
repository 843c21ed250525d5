"""Measures time and memory to load files that are hostile or damaged at random.

    python -m benchmarks.files.hostile_files [COUNT]

Loads COUNT [2500] files of each of four layouts, damaged at random by tests/storage/fuzz_files.py,
and the files of tests/storage/hostile_files.py. Each load runs in another process. `loaded, other`
counts networks with other numbers: most layouts have no checksum. Ends with exit status 1 when a
load crashed, took more than ten seconds, or raised another error than one line of WeightsError.
Needs the extra `test`; half an hour.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from benchmarks.result_files import write

STORAGE_TESTS = Path(__file__).parents[2] / "tests" / "storage"


def main(count: str = "2500") -> int:
    """Writes the files, measures them and writes the table; returns the exit status."""
    sys.path.insert(0, str(STORAGE_TESTS))
    from fuzz_files import fuzz, measure_hostile_files
    from hostile_files import LAYOUTS, write_sound
    from load_files import Loader

    from keras_pendulum.storage.quarantine import SECONDS

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with Loader(write_sound("this package", folder / "first"), 10, SECONDS) as loader:
            found = [fuzz(layout, int(count), loader, folder) for layout in LAYOUTS]
            found += measure_hostile_files(loader, folder)
    rows = [row for row, _ in found]
    failures = [failure for _, failed in found for failure in failed]
    command = "python -m benchmarks.files.hostile_files" + (f" {count}" if count != "2500" else "")
    write("hostile_files", command, rows)
    for seed, outcome in failures:
        print(f"{seed}: {outcome.kind} {outcome.text}", file=sys.stderr)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
