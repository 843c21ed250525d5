"""The study of docs: from `original` to `reference`, and `reference` without each change.

    python -m benchmarks.learning.study FOLDER [SEEDS]

Makes the default study of `keras_pendulum.study` in FOLDER/study with the training seeds 0, 1, …
(10 seeds), one worker per core. Copies its tables and its figure to docs/study, and adds the
machine to table.json. The command may be stopped and started again. It takes twenty minutes on two
cores.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

from benchmarks.result_files import ROOT, machine

DOCS = ROOT / "docs" / "study"


def table() -> dict[str, Any]:
    """Returns the table of the study in the docs."""
    content: dict[str, Any] = json.loads((DOCS / "table.json").read_text("utf-8"))
    return content


def publish(study: Path, docs: Path = DOCS) -> None:
    """Copies the tables and the figure of a study to the docs; adds the machine to table.json."""
    for name in ("table.md", "table.csv", "figure.png"):
        shutil.copyfile(study / name, docs / name)
    made = json.loads((study / "table.json").read_text("utf-8"))
    content = {"versions": made["versions"], "machine": machine(), "rows": made["rows"]}
    text = json.dumps(content, indent=2, ensure_ascii=False) + "\n"
    (docs / "table.json").write_text(text, "utf-8")


def main(folder: str, seeds: str = "10") -> int:
    """Makes the missing runs and the tables; returns the exit status of the study."""
    study = Path(folder) / "study"
    command = [sys.executable, "-m", "keras_pendulum.study", "--out", str(study), "--seeds", seeds]
    status = subprocess.run(command, check=False).returncode
    if status == 0:
        publish(study)
    return status


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
