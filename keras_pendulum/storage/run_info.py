"""The record of the run that a network comes from."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from keras_pendulum.environments.pendulum import Pendulum
from keras_pendulum.environments.task import Task
from keras_pendulum.environments.tasks import TASKS, make_task
from keras_pendulum.errors import ConfigError


@dataclass(frozen=True)
class RunInfo:
    """The run that a network comes from, as far as it is recorded.

    A network carries it as the JSON values of `as_record` in `DQN.metadata`. A weights file has the
    same values as attributes.
    """

    task: Task | None = None
    preset: str | None = None
    seed: int | None = None
    settings: Mapping[str, Any] = field(default_factory=dict)  # as config.json has them

    @classmethod
    def from_record(cls, record: Mapping[str, Any]) -> RunInfo:
        """Returns the information that `as_record` gave; other keys are ignored.

        Settings that are not a JSON object count as not recorded. Raises ConfigError for an unknown
        environment, for a gravity out of range, and for a preset or a seed of another type.
        """
        environment = record.get("environment", Pendulum.environment)
        preset, seed = record.get("preset"), record.get("seed")
        for name, value, kind in (("preset", preset, str), ("seed", seed, int)):
            if not isinstance(value, kind | None):
                raise ConfigError(f"records the {name} {value!r}; expected {kind.__name__}")
        if not isinstance(environment, str) or environment not in TASKS:
            raise ConfigError(
                f"records the environment {environment!r}; expected {' or '.join(TASKS)}"
            )
        try:
            task = make_task(environment, record)
        except KeyError:  # its physics are not recorded
            task = None
        try:
            settings = json.loads(record.get("config") or "{}")
        except (TypeError, ValueError, RecursionError):
            settings = {}
        return cls(task, preset, seed, settings if isinstance(settings, dict) else {})

    @property
    def discount(self) -> float | None:
        """γ that the network learned with; None where it is not recorded."""
        return self._number("discount", 0.0, 1.0)

    @property
    def reward_scale(self) -> float:
        """The factor on the rewards of the run; 1 where it is not recorded."""
        return self._number("reward_scale", 1e-6, 1e6) or 1.0

    def as_record(self) -> dict[str, Any]:
        """Returns what is known, as JSON values by name."""
        task = {"environment": self.task.environment, **vars(self.task)} if self.task else {}
        settings = json.dumps(self.settings) if self.settings else None
        record = {**task, "preset": self.preset, "seed": self.seed, "config": settings}
        return {name: value for name, value in record.items() if value is not None}

    def _number(self, name: str, low: float, high: float) -> float | None:
        """Returns a recorded number; None where there is none in the range."""
        value = self.settings.get(name)
        if isinstance(value, int | float) and low <= value <= high:
            return float(value)
        return None
