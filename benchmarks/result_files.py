"""The results of the benchmarks and of the study, read from their files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from benchmarks.departures import interval
from benchmarks.report import RESULTS, Row

ROOT = Path(__file__).parents[1]
STUDY = ROOT / "docs" / "study"


def rows_of(name: str) -> list[Row]:
    """Returns the rows of benchmarks/results/NAME.json."""
    rows: list[Row] = json.loads((RESULTS / f"{name}.json").read_text("utf-8"))["rows"]
    return rows


def row_of(name: str, **cells: Any) -> Row:
    """Returns the first row of a result with these cells; a column's spaces are `_` here."""
    wanted = {key.replace("_", " "): value for key, value in cells.items()}
    return next(row for row in rows_of(name) if row.items() >= wanted.items())


def machine_of(name: str) -> str:
    """Returns the sentence that says where a result was measured."""
    machine = json.loads((RESULTS / f"{name}.json").read_text("utf-8"))["machine"]
    return f"Measured on {machine.split(', tensorflow')[0]}.\n"


def study() -> dict[str, Any]:
    """Returns the table of the study."""
    table: dict[str, Any] = json.loads((STUDY / "table.json").read_text("utf-8"))
    return table


def printed_by(command: str) -> list[str]:
    """Returns the lines that a command of benchmarks.first_run printed."""
    return [row["line"] for row in rows_of("first_run") if row["command"] == command]


def number(value: float) -> str:
    """Returns a regret with three digits, such as 1.79, 73.3 or 1218."""
    return f"{value:.{2 if value < 10 else 1 if value < 100 else 0}f}"


def summary(regrets: list[float]) -> str:
    """Returns mean and worst regret, from 10 runs on with the interval of the mean."""
    uncertainty = f" ({interval(regrets)})" if len(regrets) >= 10 else ""
    return f"mean {sum(regrets) / len(regrets):.1f}{uncertainty}, worst {max(regrets):.1f}"
