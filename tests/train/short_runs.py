"""Short runs, runs that end as if they were killed, and the content of a folder."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from keras_pendulum.train.run import Run

# A run of the pendulum with updates from episode 2 on.
SHORT: dict[str, Any] = {"hidden_units": (8,), "max_episode_steps": 20, "warmup_episodes": 2}


class KilledError(Exception):
    pass


def kill_at_call(owner: Any, name: str, call: int, patched: pytest.MonkeyPatch) -> None:
    """Makes the given call of a method or function end the run."""
    function: Callable[..., Any] = getattr(owner, name)
    calls = iter(range(1, 1000))

    def wrapped(*arguments: Any, **named: Any) -> Any:
        if next(calls) == call:
            raise KilledError
        return function(*arguments, **named)

    patched.setattr(owner, name, wrapped)


def assert_same_state(ours: Run, theirs: Run) -> None:
    """Compares two runs after their last episodes, but for the wall-clock times."""
    found, expected = (
        (
            [record._replace(seconds=0.0) for record in run.history],
            run.agent.get_state(),
            run.replay.get_state(),
            run.streams.get_state(),
            run.env.unwrapped.np_random.bit_generator.state,
        )
        for run in (ours, theirs)
    )
    np.testing.assert_equal(found, expected)


def contents(folder: Path) -> dict[Path, bytes]:
    """Returns the content of each file in the folder."""
    return {file: file.read_bytes() for file in folder.iterdir()}
