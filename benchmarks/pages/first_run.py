"""What the commands of README.md print, and the pictures that they draw.

    python -m benchmarks.pages.first_run

Runs them in an empty folder. Writes what they print to benchmarks/results, and their pictures to
docs/: run.png, cartpole.png, diagnose.png, compare.png and the film swingup.gif. The shipped policy
`reference` is the run of the first line in README.md, made by `benchmarks.learning.preset_results`;
run that first. It takes a minute on two cores.
"""

from __future__ import annotations

import contextlib
import shutil
import tempfile

import keras_pendulum as kp
from benchmarks.result_files import ROOT, Row, write
from benchmarks.speed.processes import run_process
from keras_pendulum.environments.pendulum import Pendulum
from keras_pendulum.optimum.solutions import solution

_DOCS = ROOT / "docs"
SILENT = (
    "train --quiet",
    "train --quiet --preset original",
    "train --quiet --preset cartpole --evaluate-every 30",
)
COMMANDS = (
    "evaluate reference",
    "diagnose original",
    "compare runs/original-seed0 runs/reference-seed0",
)


def main() -> None:
    """Runs the commands; writes their lines and pictures."""
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        for command in (*SILENT, *COMMANDS):
            output = run_process("-m", *f"keras_pendulum.{command}".split()).output
            if command in COMMANDS:
                rows += [{"command": command, "line": line} for line in output.splitlines()]
        shutil.copy("runs/reference-seed0/rewards.png", _DOCS / "run.png")
        shutil.copy("runs/cartpole-seed0/rewards.png", _DOCS / "cartpole.png")
        shutil.copy("comparison.png", _DOCS / "compare.png")
    film = ["--start", "hanging", "--gif", str(_DOCS / "swingup.gif")]
    run_process("-m", "keras_pendulum.evaluate", "swingup", *film)
    kp.diagnose("original").figure().savefig(_DOCS / "diagnose.png", dpi=60)
    random = solution(Pendulum()).random_return()
    line = f"Uniformly random actions on the same starts: {random:.2f}"
    rows.append({"command": "train", "line": line})
    write("first_run", "python -m benchmarks.pages.first_run", rows)


if __name__ == "__main__":
    main()
