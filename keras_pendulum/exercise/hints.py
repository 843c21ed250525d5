"""The texts of an exercise: the list, the task of one, and its hints."""

from __future__ import annotations

from keras_pendulum.diagnosis.faults import FAULTS
from keras_pendulum.exercise.program import exercise
from keras_pendulum.exercise.table import EXERCISES

HINTS = (1, 2, 3)


def listing() -> str:
    """Returns a line for each exercise: its number, task and symptom."""
    return "\n".join(
        f"{number:2}  {each.environment:11}  {each.symptom}" for number, each in EXERCISES.items()
    )


def task(number: int, prog: str) -> str:
    """Returns what a student reads about an exercise before the first run."""
    each = exercise(number)
    return "\n".join(
        [
            f"Exercise {number}, {each.environment}. This program has one fault.",
            f"What you will see: {each.symptom}",
            f"Write it:   {prog} {number} --out my_dqn.py",
            "Run it:     python my_dqn.py",
            f"Get a hint: {prog} {number} --hint (then --hint 2, --hint 3)",
            f"Check it:   {prog} {number} --check my_dqn.py",
        ]
    )


def hint(number: int, step: int) -> str:
    """Returns the first, second or third hint; the last one is the solution.

    `step` is one of HINTS. Raises UserError for a number that no exercise has.
    """
    each = exercise(number)
    return (
        f"Hint 1 of 3. {each.question}",
        f"Hint 2 of 3. It belongs to {each.finding}: {FAULTS[each.finding].explanation} "
        f"(docs/my_dqn_does_not_learn.md#{each.finding})",
        f"Hint 3 of 3, the solution. See {each.place}. {each.solution}",
    )[step - 1]
