"""Whole processes: their duration, their peak memory and what they print."""

from __future__ import annotations

import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple, TypeVar

import psutil

Measured = TypeVar("Measured")


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
    with tempfile.TemporaryFile("w+", encoding="utf-8") as output:
        started = time.perf_counter()
        process = subprocess.Popen(command, stdout=output)
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


def in_turns(
    names: Iterable[str], measure: Callable[[str, int], Measured], rounds: int
) -> dict[str, list[Measured]]:
    """Returns what `measure(name, round)` returns, by name, for each round.

    Each round measures all names, because a shared machine is faster in one minute than in another.
    """
    measured: dict[str, list[Measured]] = {name: [] for name in names}
    for number in range(rounds):
        for name, results in measured.items():
            results.append(measure(name, number))
    return measured
