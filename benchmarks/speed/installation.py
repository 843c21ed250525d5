"""What an installation takes: disk and minutes, and the minutes of the programs in examples/.

    python -m benchmarks.speed.installation

Makes an environment in a temporary folder, and installs this package and then Stable-Baselines3 in
it. The time of an installation depends on the network and on what pip has stored.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.result_files import ROOT, Row, write

SB3 = "stable-baselines3"
PROGRAMS = ("my_dqn.py", "sb3_dqn.py")


def disk(folder: Path) -> int:
    """Returns the megabytes of all files in a folder."""
    return round(sum(path.lstat().st_size for path in folder.rglob("*")) / 1e6)


def seconds_of(*line: str | Path) -> tuple[float, str]:
    """Returns how long a command takes, and what it prints. Raises CalledProcessError."""
    started = time.perf_counter()
    # Outside of the checkout, so that the installed package is imported.
    environment = {name: text for name, text in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run(
        list(map(str, line)),
        stdout=subprocess.PIPE,
        text=True,
        check=True,
        env=environment,
        cwd=tempfile.gettempdir(),
    )
    return time.perf_counter() - started, done.stdout


def row(name: str, seconds: float, megabytes: int | None = None, regret: str = "–") -> Row:
    """Returns the row of an installation or of a program."""
    return {
        "what": name,
        "disk, MB": "–" if megabytes is None else f"{megabytes}",
        "minutes": f"{seconds / 60:.1f}",
        "regret": regret,
    }


def main() -> None:
    """Installs, runs the programs, and writes the table."""
    rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        subprocess.run([sys.executable, "-m", "venv", name], check=True)
        python = folder / ("Scripts" if os.name == "nt" else "bin") / "python"
        pip = (python, "-m", "pip", "install", "-q")
        seconds, _ = seconds_of(*pip, "-e", ROOT)
        rows.append(row("the package and TensorFlow", seconds, disk(folder)))
        before = disk(folder)
        requirements = (ROOT / "setup.cfg").read_text(encoding="utf-8")
        versions = re.findall(rf"^    ((?:torch|{SB3})==\S+)$", requirements, re.MULTILINE)
        seconds, _ = seconds_of(*pip, *sorted(set(versions)))
        rows.append(row("Stable-Baselines3 and PyTorch besides", seconds, disk(folder) - before))
        for program in PROGRAMS:
            seconds, printed = seconds_of(python, ROOT / "examples" / program)
            regret = re.findall(r"^Regret: (\S+)", printed, re.MULTILINE)[0]
            rows.append(row(f"`examples/{program}`", seconds, regret=regret))
    write("installation", "python -m benchmarks.speed.installation", rows)


if __name__ == "__main__":
    main()
