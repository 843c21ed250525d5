"""Exercises whose fault a few thousand steps show: the diagnosis names it first."""

from __future__ import annotations

from pathlib import Path

import pytest
from program_runs import assert_fault_is_named

STEPS = 1_600
SHOWN = (2, 4, 5, 6, 7, 8, 9, 12, 13, 14, 15, 16, 18, 19)


@pytest.mark.parametrize("number", SHOWN)
def test_diagnosis_names_the_fault_first(number: int, tmp_path: Path) -> None:
    assert_fault_is_named(number, STEPS, tmp_path)
