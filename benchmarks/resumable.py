"""Results in a file of lines, so that a benchmark can be stopped and started again."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

Result = dict[str, Any]


def measure_each(
    items: Iterable[tuple[str, Callable[[], Result]]], folder: str, name: str
) -> list[Result]:
    """Returns the result of each item; those in FOLDER/NAME.jsonl are used again.

    Args:
        items: the key of each item, and the function that measures it.
        folder: made if it is missing.
        name: of the file.
    """
    file = Path(folder) / f"{name}.jsonl"
    file.parent.mkdir(parents=True, exist_ok=True)
    lines = file.read_text("utf-8").splitlines() if file.exists() else []
    known: dict[str, Result] = dict(map(json.loads, lines))
    results = []
    for key, measure in items:
        if key not in known:
            known[key] = json.loads(json.dumps(measure()))
            with file.open("a", encoding="utf-8") as stream:
                stream.write(json.dumps([key, known[key]]) + "\n")
            print(known[key], flush=True)
        results.append(known[key])
    return results
