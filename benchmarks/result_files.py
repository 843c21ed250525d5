"""The files of results: the tables of the benchmarks with the machine they ran on."""

from __future__ import annotations

import json
import os
import platform
import sys
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "benchmarks" / "results"
_PACKAGES = ("tensorflow-cpu", "tensorflow", "keras", "gymnasium", "numpy")

Row = dict[str, Any]


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


def write(name: str, command: str, rows: Sequence[Row], *, also: Sequence[str] = ()) -> None:
    """Writes the rows as JSON and Markdown to benchmarks/results, and prints them.

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
    text = f"`{command}`\n\n{markdown(rows)}\n{setup}.\n"
    (RESULTS / f"{name}.md").write_text(text, encoding="utf-8")
    print(text)


def rows_of(name: str) -> list[Row]:
    """Returns the rows of benchmarks/results/NAME.json."""
    rows: list[Row] = json.loads((RESULTS / f"{name}.json").read_text("utf-8"))["rows"]
    return rows


def machine_of(name: str) -> str:
    """Returns the sentence that says where a result was measured."""
    machine = json.loads((RESULTS / f"{name}.json").read_text("utf-8"))["machine"]
    return f"Measured on {machine.split(', tensorflow')[0]}.\n"
