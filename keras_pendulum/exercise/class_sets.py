"""The exercises of a class: a folder for each student, and the key for the teacher."""

from __future__ import annotations

import math
import random
from collections import Counter
from pathlib import Path

from keras_pendulum.errors import UserError, report_os_error
from keras_pendulum.exercise.program import program
from keras_pendulum.exercise.table import EXERCISES
from keras_pendulum.storage.atomic_write import write_atomically

KEY = "teacher_key.md"
LARGEST_CLASS = 200


def deal(students: int, each: int, seed: int) -> list[tuple[int, ...]]:
    """Returns the exercises of each student, sorted; no two students have the same ones.

    The exercises are used equally often, as far as that is possible.

    Args:
        students: their number.
        each: exercises of a student.
        seed: of the choice.

    Raises UserError where the class is too large, or a student would have too many exercises.
    """
    if not 1 <= each < len(EXERCISES):
        raise UserError(f"--each is {each}; expected 1 to {len(EXERCISES) - 1}")
    most = min(LARGEST_CLASS, math.comb(len(EXERCISES), each))
    if not 1 <= students <= most:
        raise UserError(f"--class is {students}; expected 1 to {most} with {each} for each student")
    chance = random.Random(seed)
    used: Counter[int] = Counter()
    sets: list[tuple[int, ...]] = []
    while len(sets) < students:
        for attempt in range(1000):
            noise = 0.5 + attempt / 10  # above 1, an exercise that was used more often may be dealt
            order = {n: used[n] + noise * chance.random() for n in EXERCISES}
            chosen = tuple(sorted(sorted(EXERCISES, key=order.__getitem__)[:each]))
            if chosen not in sets:
                break
        sets.append(chosen)
        used.update(chosen)
    return sets


def write_class(students: int, each: int, seed: int, folder: Path) -> None:
    """Writes the folder of a class.

    `student_01/` and the others have the programs `exercise_07.py` and tasks.txt, with what a
    student will see. The key for the teacher is in teacher_key.md.

    Raises UserError as `deal` does, where the folder exists and is not empty, and when the file
    system refuses.
    """
    sets = deal(students, each, seed)
    with report_os_error(f"cannot write {folder}"):
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise UserError(f"{folder} exists and is not an empty folder: name another one")
        for number, exercises in enumerate(sets, 1):
            own = folder / f"student_{number:02}"
            own.mkdir(parents=True)
            for each_number in exercises:
                path = own / f"exercise_{each_number:02}.py"
                write_atomically(path, program(each_number).encode())
            write_atomically(own / "tasks.txt", _tasks(exercises).encode())
    write_atomically(folder / KEY, _key(sets, seed).encode())


def _tasks(exercises: tuple[int, ...]) -> str:
    lines = [
        "Each program has one fault: one to three lines are not as they should be.",
        "Run it, look at what it prints, find the fault, and repair it. Then check it.",
    ]
    for number in exercises:
        each, file = EXERCISES[number], f"exercise_{number:02}.py"
        lines += [
            "",
            f"Exercise {number}, {each.environment}",
            f"  What you will see: {each.symptom}",
            f"  Run:   python {file}",
            f"  Hint:  python -m keras_pendulum.exercise {number} --hint",
            f"  Check: python -m keras_pendulum.exercise {number} --check {file}",
        ]
    return "\n".join([*lines, ""])


def _key(sets: list[tuple[int, ...]], seed: int) -> str:
    dealt = {number: EXERCISES[number] for number in sorted(set().union(*sets))}
    return "\n".join(
        [
            f"# Key of a class of {len(sets)}, seed {seed}",
            "",
            "| student | exercises |",
            "|---|---|",
            *(f"| {n:02} | {', '.join(map(str, own))} |" for n, own in enumerate(sets, 1)),
            "",
            "| exercise | task | finding | place | solution |",
            "|---|---|---|---|---|",
            *(
                f"| {n} | {each.environment} | {each.finding} | {each.place} | {each.solution} |"
                for n, each in dealt.items()
            ),
            "",
        ]
    )
