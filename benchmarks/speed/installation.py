"""What the package takes on the disk, and how long it takes to install.

    python -m benchmarks.speed.installation [EXTRA …]

Makes a virtual environment for each extra (none, `study` and `test` by default), installs the
package in it as docs/install.md says, and deletes it again. The minutes include the download, so
they depend on the connection. It takes three minutes.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
import venv
from pathlib import Path

from benchmarks.result_files import ROOT, Row, write

EXTRAS = ("", "study", "test")


def measure(extra: str) -> Row:
    """Returns the minutes and the size of an installation with one extra; `""` is none."""
    package = f"{ROOT}[{extra}]" if extra else str(ROOT)
    with tempfile.TemporaryDirectory() as folder:
        began = time.perf_counter()
        venv.create(folder, with_pip=True)
        python = Path(folder, "Scripts" if sys.platform == "win32" else "bin", "python")
        subprocess.run([python, "-m", "pip", "install", "-q", "-e", package], check=True)
        minutes = (time.perf_counter() - began) / 60
        files = [each for each in Path(folder).rglob("*") if not each.is_symlink()]
        size = sum(each.stat().st_size for each in files if each.is_file())
    return {
        "installed": f'`pip install -e ".[{extra}]"`' if extra else "`pip install -e .`",
        "minutes": round(minutes, 1),
        "GB on the disk": round(size / 1e9, 1),
    }


def main(*extras: str) -> None:
    """Measures and writes the table."""
    rows = [measure(extra) for extra in extras or EXTRAS]
    write("installation", "python -m benchmarks.speed.installation", rows)


if __name__ == "__main__":
    main(*sys.argv[1:])
