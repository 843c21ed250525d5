"""Whole runs of examples/my_dqn.py, on both tasks, and of examples/sb3_dqn.py.

    python -m benchmarks.learning.example_programs [RUNS]

Runs the programs as they are, with the seeds 0, 1, … (2 of them), and takes from what they print
the regret and whether `diagnose` finds something. Each run is a process. The program of
Stable-Baselines3 is left out if that library is missing. It takes three minutes.
"""

from __future__ import annotations

import re
import sys
import tempfile
from pathlib import Path

from benchmarks.result_files import ROOT, Row, write
from benchmarks.speed.processes import median, run_process

EXAMPLES = ROOT / "examples"
# File, words of the file, and what replaces them; SEED is the seed.
PROGRAMS = {
    "my_dqn.py": ("my_dqn.py", {"= train()": "= train(seed=SEED)"}),
    "my_dqn.py, CartPole": (
        "my_dqn.py",
        {
            "= train()": "= train(seed=SEED)",
            'ENVIRONMENT = "Pendulum-v1"': 'ENVIRONMENT = "CartPole-v1"',
        },
    ),
    "sb3_dqn.py": ("sb3_dqn.py", {"= train(env)": "= train(env, seed=SEED)"}),
}


def program_text(name: str, seed: int) -> str:
    """Returns the text of a program with a seed."""
    file, changes = PROGRAMS[name]
    text = (EXAMPLES / file).read_text(encoding="utf-8")
    for old, new in changes.items():
        if text.count(old) != 1:
            raise ValueError(f"{file}: expected {old!r} once")
        text = text.replace(old, new.replace("SEED", str(seed)))
    return text


def measured(name: str, runs: int) -> Row:
    """Returns the row of a program."""
    processes = []
    for seed in range(runs):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "program.py"
            path.write_text(program_text(name, seed), encoding="utf-8")
            processes.append(run_process(str(path)))
        print(f"{name}, seed {seed}: {processes[-1].seconds:.0f} s", flush=True)
    outputs = [each.output for each in processes]
    healthy = sum("\nNo finding" in each for each in outputs)
    return {
        "program": f"examples/{name}",
        "seconds of the whole process": round(median([each.seconds for each in processes], 0)),
        "regrets": ", ".join(re.findall(r"^Regret: (\S+)", "\n".join(outputs), re.MULTILINE)),
        "runs without a finding": f"{healthy} of {runs}" if name.startswith("my") else "–",
    }


def main(runs: str = "2") -> None:
    """Makes the runs and writes the table."""
    libraries = run_process("-m", "benchmarks.learning.other_libraries").output.splitlines()
    has_sb3 = any(each.startswith("stable-baselines3 ") for each in libraries)
    names = [name for name in PROGRAMS if name != "sb3_dqn.py" or has_sb3]
    rows = [measured(name, int(runs)) for name in names]
    command = f"python -m benchmarks.learning.example_programs {runs}"
    write("example_programs", command, rows, also=libraries)


if __name__ == "__main__":
    main(*sys.argv[1:])
