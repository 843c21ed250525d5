"""Short runs of the programs of the exercises, and what `diagnose` finds in them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from keras_pendulum.exercise.check import answer
from keras_pendulum.exercise.program import exercise, program
from keras_pendulum.exercise.trial import run_trial


def result_of(text: str, environment: str, steps: int, folder: Path) -> dict[str, Any]:
    """Returns the result of a trial of a program with this text."""
    path = folder / "my_dqn.py"
    path.write_text(text, encoding="utf-8")
    return run_trial(path, environment, steps)


def assert_fault_is_named(number: int, steps: int, folder: Path) -> None:
    each = exercise(number)
    result = result_of(program(number), each.environment, steps, folder)
    assert result["findings"][0]["name"] == each.finding, result["verdict"]
    healthy, text = answer(number, result)
    assert not healthy
    assert f"\n1. {each.finding}" in text
