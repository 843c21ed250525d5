"""Short runs, runs that end as if they were killed, and the content of a folder."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

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


def contents(folder: Path) -> dict[Path, bytes]:
    """Returns the content of each file in the folder."""
    return {file: file.read_bytes() for file in folder.iterdir()}
