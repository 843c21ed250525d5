"""Short runs of the programs of the exercises, and what `diagnose` finds in them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from keras_pendulum.exercise.program import program
from keras_pendulum.exercise.table import PENDULUM
from keras_pendulum.exercise.trial import run_trial


def result_of(text: str, environment: str, steps: int, folder: Path) -> dict[str, Any]:
    """Returns the result of a trial of a program with this text."""
    path = folder / "my_dqn.py"
    path.write_text(text, encoding="utf-8")
    return run_trial(path, environment, steps)


def healthy_program(environment: str) -> str:
    """Returns the program without a fault, for an environment."""
    return program(0).replace(f'ENVIRONMENT = "{PENDULUM}"', f'ENVIRONMENT = "{environment}"')
