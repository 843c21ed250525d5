"""Exercises whose fault shows in learned values, and the program without a fault."""

from __future__ import annotations

from pathlib import Path

import pytest
from program_runs import assert_fault_is_named, result_of
from test_faults_of_the_record import SHOWN

from keras_pendulum.exercise.check import answer
from keras_pendulum.exercise.program import program
from keras_pendulum.exercise.table import CARTPOLE, EXERCISES, PENDULUM

STEPS = 8_000
# The mean and the maximum of the next values differ where the network has learned to act.
LEARNED = {1: STEPS, 3: 20_000, 10: STEPS, 11: STEPS, 17: STEPS, 20: STEPS}


def test_every_exercise_has_a_test() -> None:
    assert sorted((*SHOWN, *LEARNED)) == list(EXERCISES)


@pytest.mark.parametrize("number", LEARNED)
def test_diagnosis_names_the_fault_first(number: int, tmp_path: Path) -> None:
    assert_fault_is_named(number, LEARNED[number], tmp_path)


def test_program_without_a_fault_is_healthy(tmp_path: Path) -> None:
    result = result_of(program(0), PENDULUM, STEPS, tmp_path)
    assert answer(1, result)[0], result["verdict"]


def test_cartpole_program_without_a_fault_gets_the_name_of_none(tmp_path: Path) -> None:
    # It is healthy after its 40,000 steps. A shorter run can end between two good policies.
    text = program(0).replace(f'ENVIRONMENT = "{PENDULUM}"', f'ENVIRONMENT = "{CARTPOLE}"')
    result = result_of(text, CARTPOLE, 12_000, tmp_path)
    assert {each["name"] for each in result["findings"]} <= {"not-converged"}, result["verdict"]
