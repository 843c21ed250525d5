"""The tasks of this package, by the names of their environments."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from keras_pendulum.environments.cartpole import CartPole
from keras_pendulum.environments.pendulum import Pendulum
from keras_pendulum.environments.task import Task
from keras_pendulum.errors import ConfigError

TASKS: dict[str, type[Task]] = {task.environment: task for task in (Pendulum, CartPole)}


def declared_task(environment: str) -> Task:
    """Returns the task of an environment that a user names, with its usual physics.

    Raises ConfigError for an unknown name.
    """
    if environment not in TASKS:
        raise ConfigError(f"environment is {environment!r}; expected {' or '.join(TASKS)}")
    return TASKS[environment]()


def make_task(environment: str, settings: Mapping[str, Any]) -> Task:
    """Returns the task of an environment of TASKS, with those of the settings that it takes.

    Raises KeyError where one of them is missing, and ConfigError for one out of range.
    """
    task: Any = TASKS[environment]
    return task(**{each.name: settings[each.name] for each in fields(task)})
