"""What every benchmark shares: whole processes timed, and tables written with their machine."""

from __future__ import annotations

import json
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, NamedTuple

import keras_pendulum as kp
from keras_pendulum.environment import TASKS

RESULTS = Path(__file__).parent / "results"
_PACKAGES = ("tensorflow-cpu", "tensorflow", "keras", "gymnasium", "numpy")

Row = dict[str, Any]


class Process(NamedTuple):
    """A process that has ended well."""

    seconds: float  # from its start to its end
    peak_memory: float  # MB, resident
    output: str


def run_process(*words: str, python: str = sys.executable) -> Process:
    """Runs `python WORDS` and waits for it. Raises CalledProcessError when it fails."""
    command = [python, *words]
    with tempfile.TemporaryFile("w+") as output:
        started = time.perf_counter()
        process = subprocess.Popen(command, stdout=output)
        _, status, usage = os.wait4(process.pid, 0)
        seconds = time.perf_counter() - started
        process.returncode = os.waitstatus_to_exitcode(status)
        output.seek(0)
        text = output.read()
    if process.returncode != 0:
        raise subprocess.CalledProcessError(process.returncode, command, text)
    return Process(seconds, usage.ru_maxrss * 1024 / 1e6, text)


def median(values: Sequence[float], digits: int = 1) -> float:
    """Their median, rounded."""
    return round(statistics.median(values), digits)


def versions(packages: Sequence[str]) -> list[str]:
    """Those of `packages` that are installed, with their versions."""
    found = []
    for package in packages:
        try:
            found.append(f"{package} {version(package)}")
        except PackageNotFoundError:
            continue
    return found


def machine() -> str:
    """This machine and what runs on it, in one line."""
    model = platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        names = [line for line in cpuinfo.read_text().splitlines() if line.startswith("model name")]
        model = names[0].split(":")[1].strip() if names else model
    parts = [f"{os.cpu_count()} cores of {model}", f"Python {platform.python_version()}"]
    return ", ".join(parts + versions(_PACKAGES))


def best_mean_return(score: kp.Score) -> float:
    """The best possible mean return on a score's starts.

    CartPole's is all that an episode can give, as soon as one policy reaches it.
    """
    if TASKS[score.environment].has_torque:
        return score.optimal_mean_return
    return float(TASKS[score.environment].steps_per_episode)


def markdown(rows: Sequence[Row]) -> str:
    """A Markdown table; the keys of the first row are its head."""
    head = list(rows[0])
    lines = [head, ["---"] * len(head), *([row[key] for key in head] for row in rows)]
    return "".join(f"| {' | '.join(map(str, line))} |\n" for line in lines)


def write(name: str, command: str, rows: Sequence[Row], *, also: Sequence[str] = ()) -> str:
    """Writes the rows as JSON and Markdown to benchmarks/results; returns the Markdown table.

    `also` are packages, with versions, that took part beside the ones in this environment.
    """
    RESULTS.mkdir(exist_ok=True)
    where = ", ".join([machine(), *also])
    content = {"command": command, "machine": where, "rows": list(rows)}
    (RESULTS / f"{name}.json").write_text(
        json.dumps(content, indent=2, ensure_ascii=False) + "\n", encoding="utf-8"
    )
    table = markdown(rows)
    text = f"`{command}`\n\n{table}\n{where}.\n"
    (RESULTS / f"{name}.md").write_text(text, encoding="utf-8")
    print(text)
    return table
