"""Exercises whose fault a few thousand steps show: the diagnosis names it first."""

from __future__ import annotations

from pathlib import Path

import pytest
from program_runs import result_of

from keras_pendulum.exercise.check import answer
from keras_pendulum.exercise.program import exercise, program

STEPS = 1_600
SHOWN = (2, 4, 5, 6, 7, 8, 9, 12, 13, 14, 15, 16, 18, 19)


@pytest.mark.parametrize("number", SHOWN)
def test_diagnosis_names_the_fault_first(number: int, tmp_path: Path) -> None:
    each = exercise(number)
    result = result_of(program(number), each.environment, STEPS, tmp_path)
    assert result["findings"][0]["name"] == each.finding, result["verdict"]
    healthy, text = answer(number, result)
    assert not healthy
    assert f"\n1. {each.finding}" in text
