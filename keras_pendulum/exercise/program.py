"""The programs: the one without a fault, and that of each exercise; where they are written."""

from __future__ import annotations

from importlib import resources
from pathlib import Path

from keras_pendulum.errors import UserError
from keras_pendulum.exercise.table import EXERCISES, PENDULUM, Exercise
from keras_pendulum.storage.atomic_write import require_no_other_file, write_atomically

NAME = "my_dqn.py"


def exercise(number: int) -> Exercise:
    """Returns an exercise. Raises UserError for a number that none has."""
    if number not in EXERCISES:
        raise UserError(
            f"there is no exercise {number}; expected a number from 1 to {max(EXERCISES)}"
        )
    return EXERCISES[number]


def program(number: int) -> str:
    """Returns the text of the program of an exercise; 0 is the one without a fault.

    Raises UserError for a number that no exercise has.
    """
    text = _healthy_program()
    if number == 0:
        return text
    environment, _, changes, *_ = exercise(number)
    line = 'ENVIRONMENT = "{}"'
    for old, new in ((line.format(PENDULUM), line.format(environment)), *changes):
        if (count := text.count(old)) != 1:
            raise ValueError(f"exercise {number}: {old!r} is {count} times in {NAME}")
        text = text.replace(old, new)
    return text


def write_program(number: int, path: Path) -> None:
    """Writes the program of an exercise; 0 is the one without a fault.

    Raises UserError for a number that no exercise has, when the file system refuses, and where the
    path holds anything else than an unchanged program of this command.
    """
    text = program(number).encode()
    require_no_other_file(path, text[:40], "a program of this command")
    if path.is_file() and path.read_bytes() not in [
        program(each).encode() for each in (0, *EXERCISES)
    ]:
        raise UserError(f"{path} holds changes of your own: name another file")
    write_atomically(path, text)


def _healthy_program() -> str:
    """Returns examples/my_dqn.py, of which a wheel has a copy in this room."""
    package = Path(str(resources.files("keras_pendulum")))
    in_wheel = package / "exercise" / NAME
    path = in_wheel if in_wheel.is_file() else package.parent / "examples" / NAME
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise UserError(
            f"cannot read {path}: {error.strerror}; install the package again"
        ) from error
