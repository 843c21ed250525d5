"""The timing of whole processes, and the tables of the benchmarks with the machine they ran on."""

from __future__ import annotations

import json
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, NamedTuple

import psutil

RESULTS = Path(__file__).parent / "results"
_PACKAGES = ("tensorflow-cpu", "tensorflow", "keras", "gymnasium", "numpy")

Row = dict[str, Any]


class Process(NamedTuple):
    """A process that has ended with exit status 0."""

    seconds: float  # from its start to its end
    peak_memory: float  # MB, resident; see PeakMemory
    output: str


class PeakMemory:
    """The largest resident memory of a process in the `with` block, sampled every 10 ms.

    Samples are the same on every system. They miss a peak that lasts for less than 10 ms.

    Args:
        process: id of the process.
    """

    def __init__(self, process: int) -> None:
        self.megabytes = 0.0
        self._process = psutil.Process(process)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._sample, daemon=True)

    def __enter__(self) -> PeakMemory:
        self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._stop.set()
        self._thread.join()

    def _sample(self) -> None:
        try:
            while not self._stop.wait(0.01):
                self.megabytes = max(self.megabytes, resident_memory(self._process))
        except psutil.NoSuchProcess:  # it has ended
            return


def resident_memory(process: psutil.Process) -> float:
    """Returns the resident memory of a process in MB."""
    return float(process.memory_info().rss / 1e6)


def run_process(*arguments: str, python: str = sys.executable) -> Process:
    """Runs `python ARGUMENTS` and waits for it. Raises CalledProcessError when it fails."""
    command = [python, *arguments]
    # As from a shell: this package sets the number of threads for its own process only.
    environment = {**os.environ}
    environment.pop("TF_NUM_INTRAOP_THREADS", None)
    with tempfile.TemporaryFile("w+", encoding="utf-8") as output:
        started = time.perf_counter()
        process = subprocess.Popen(command, stdout=output, env=environment)
        with PeakMemory(process.pid) as peak:
            process.wait()
            seconds = time.perf_counter() - started
        output.seek(0)
        text = output.read()
    if process.returncode != 0:
        raise subprocess.CalledProcessError(process.returncode, command, text)
    return Process(seconds, peak.megabytes, text)


def median(values: Sequence[float], digits: int = 1) -> float:
    """Returns the median, rounded to so many digits."""
    return round(statistics.median(values), digits)


def versions(packages: Sequence[str]) -> list[str]:
    """Returns name and version of each of the packages that is installed."""
    found = []
    for package in packages:
        try:
            found.append(f"{package} {version(package)}")
        except PackageNotFoundError:
            continue
    return found


def machine() -> str:
    """Returns one line with the processor and the versions of Python and the packages."""
    model = platform.processor() or platform.machine()
    if sys.platform == "linux":
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        names = [line for line in lines if line.startswith("model name")]
        model = names[0].split(":")[1].strip() if names else model
    parts = [f"{os.cpu_count()} cores of {model}", f"Python {platform.python_version()}"]
    return ", ".join(parts + versions(_PACKAGES))


def markdown(rows: Sequence[Row]) -> str:
    """Returns a Markdown table; its header is the keys of the first row."""
    header = list(rows[0])
    lines = [header, ["---"] * len(header), *([row[key] for key in header] for row in rows)]
    return "".join(f"| {' | '.join(map(str, line))} |\n" for line in lines)


def write(name: str, command: str, rows: Sequence[Row], *, also: Sequence[str] = ()) -> str:
    """Writes the rows as JSON and Markdown to benchmarks/results; returns the Markdown table.

    Args:
        name: of the two files.
        command: the command that measured the rows.
        rows: all with the same keys.
        also: further packages with their versions, in this environment or in that of a peer.
    """
    RESULTS.mkdir(exist_ok=True)
    setup = ", ".join([machine(), *also])
    content = {"command": command, "machine": setup, "rows": list(rows)}
    (RESULTS / f"{name}.json").write_text(
        json.dumps(content, indent=2, ensure_ascii=False) + "\n", encoding="utf-8"
    )
    table = markdown(rows)
    text = f"`{command}`\n\n{table}\n{setup}.\n"
    (RESULTS / f"{name}.md").write_text(text, encoding="utf-8")
    print(text)
    return table
