"""The scenes, by the names of their environments."""

from __future__ import annotations

from typing import Any

from keras_pendulum.environments.task import Task
from keras_pendulum.errors import ConfigError
from keras_pendulum.figures.cartpole_scene import CartPoleScene
from keras_pendulum.figures.pendulum_scene import PendulumScene
from keras_pendulum.figures.scene import Scene

SCENES: dict[str, Any] = {  # classes that take the task
    "Pendulum-v1": PendulumScene,
    "CartPole-v1": CartPoleScene,
}


def scene(task: Task) -> Scene:
    """Returns the drawings of a task. Raises ConfigError for a task without any."""
    if task.environment not in SCENES:
        raise ConfigError(f"{task.environment} cannot be drawn; these can: {', '.join(SCENES)}")
    drawn: Scene = SCENES[task.environment](task)
    return drawn
