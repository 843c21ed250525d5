"""A trial: trains a student's program, evaluates and diagnoses what it returns.

`check` starts this module as a process of its own: `python -m keras_pendulum.exercise.trial
PROGRAM ENVIRONMENT RESULT`. The program's own output is the output of the process.
"""

from __future__ import annotations

import importlib.util
import json
import sys
import time
from pathlib import Path
from types import ModuleType
from typing import Any

from keras_pendulum.cli import run_command
from keras_pendulum.errors import UserError

_NEEDED = ("ENVIRONMENT", "ACTIONS", "DISCOUNT", "REWARD_SCALE", "train")


def run_trial(path: Path, environment: str, steps: int | None = None) -> dict[str, Any]:
    """Trains the program at `path`; returns what `Diagnosis.as_json` does, and more.

    Added are `random_return`, `optimum` (both mean returns of the starts) and `seconds` of the
    training.

    Args:
        path: the program, as `exercise` writes it: its `train()` returns the network, the replay
            buffer and the environment.
        environment: the one that it should have.
        steps: of the training; None takes those of the program.

    Raises UserError for a program without one of these names, and for another environment. What
    the program raises passes through.
    """
    names = vars(_imported(path))
    if missing := [name for name in _NEEDED if name not in names]:
        raise UserError(f"{path} has no {missing[0]}; the check needs {', '.join(_NEEDED)}")
    if names["ENVIRONMENT"] != environment:
        raise UserError(f"{path}: ENVIRONMENT is {names['ENVIRONMENT']!r}; expected {environment}")
    began = time.perf_counter()
    try:
        network, buffer, env = names["train"](**({} if steps is None else {"steps": steps}))
        transitions = buffer.all()
    except (TypeError, ValueError, AttributeError) as error:
        if error.__traceback__ is not None and error.__traceback__.tb_next is not None:
            raise  # from within the program
        raise UserError(f"{path}: train() does not return network, buffer, env: {error}") from error
    seconds = time.perf_counter() - began

    from keras_pendulum.diagnosis.diagnose import diagnose

    task = {"gravity": 10.0, "torques": names["ACTIONS"]} if environment == "Pendulum-v1" else {}
    diagnosis = diagnose(
        network,
        environment=environment,
        discount=names["DISCOUNT"],
        reward_scale=names["REWARD_SCALE"],
        record=env if hasattr(env, "steps") else None,
        transitions=transitions,
        **task,
    )
    measurement = diagnosis.measurement
    return {
        **diagnosis.as_json(),
        "random_return": measurement.dynamics.random_return(),
        "optimum": measurement.optimum,
        "seconds": seconds,
    }


def _imported(path: Path) -> ModuleType:
    """Returns the program as a module, so it does not train yet."""
    spec = importlib.util.spec_from_file_location("my_dqn", path)
    if spec is None or spec.loader is None:
        raise UserError(f"{path} is not a program of Python: its name ends in .py")
    module = sys.modules["my_dqn"] = importlib.util.module_from_spec(spec)
    sys.path.insert(0, str(path.parent))  # as Python does for a program
    spec.loader.exec_module(module)
    return module


def main() -> int:
    """Runs the trial of PROGRAM with ENVIRONMENT, and writes the result to RESULT."""
    path, environment, result = sys.argv[1:]

    def trial() -> int:
        content = run_trial(Path(path), environment)
        Path(result).write_text(json.dumps(content), encoding="utf-8")
        return 0

    return run_command(trial)


if __name__ == "__main__":
    sys.exit(main())
