"""The check of a program: it runs in a process of its own, and the answer is in words."""

from __future__ import annotations

import json
import math
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from keras_pendulum.errors import UserError
from keras_pendulum.exercise.program import exercise

_ENOUGH = 0.96  # share of what can be gained over random actions


def check(number: int, path: Path, seconds: float) -> tuple[bool, str]:
    """Runs a student's program; returns whether it is healthy, and the answer.

    The output of the program is shown while it runs.

    Args:
        number: of the exercise.
        path: the program.
        seconds: the longest time that it may take.

    Raises UserError for a number that no exercise has, for a missing file, for a program that ends
    with an error, and for one that takes too long.
    """
    environment = exercise(number).environment
    if not path.is_file():
        raise UserError(f"{path}: no such file; write it with `exercise {number} --out {path}`")
    with tempfile.TemporaryDirectory() as folder:
        result = Path(folder, "result.json")
        words = [sys.executable, "-m", "keras_pendulum.exercise.trial"]
        try:
            status = subprocess.run(
                [*words, str(path), environment, str(result)], timeout=seconds, check=False
            ).returncode
        except subprocess.TimeoutExpired as error:
            raise UserError(
                f"{path} was stopped after {seconds:g} s; does a loop not end? --limit allows more"
            ) from error
        if status != 0 or not result.is_file():
            raise UserError(
                f"{path} ended with an error, so it was not judged: see the lines above"
            )
        return answer(number, json.loads(result.read_text(encoding="utf-8")))


def answer(number: int, result: dict[str, Any]) -> tuple[bool, str]:
    """Returns whether the result of a trial is healthy, and the answer in words.

    It is healthy where `diagnose` finds nothing, the fault of the exercise costs nothing either,
    and the policy gains nearly all that can be gained over random actions.
    """
    regret = result["regret"]
    regret = math.inf if regret is None else regret
    allowed = (1 - _ENOUGH) * (result["optimum"] - result["random_return"])
    own = exercise(number).finding
    found = result["findings"] + [note for note in result["notes"] if note["name"] == own]
    size = f"regret {regret:.1f} (up to {allowed:.0f} is healthy)"
    if not found and regret <= allowed:
        return True, f"Healthy: {size}, and diagnose finds nothing. Exercise {number} is solved."
    lines = [f"Not healthy yet: {size}."]
    for place, finding in enumerate(found, 1):
        variant = f" ({finding['variant']})" if finding["variant"] else ""
        lines += [
            f"{place}. {finding['name']}{variant}: {finding['evidence']} "
            f"(healthy: {finding['healthy']})",
            f"   {finding['explanation']}",
            f"   Read: {finding['page']}",
        ]
    if not found:
        lines.append(
            "diagnose finds nothing. Try another seed, in train(), before you look for a fault."
        )
    lines.append(f"A hint: exercise {number} --hint")
    return False, "\n".join(lines)
