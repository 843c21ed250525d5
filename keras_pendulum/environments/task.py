"""A task: an environment of Gymnasium, and what the package knows of it before it is made."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, ClassVar, Self

from keras_pendulum.display import require_display
from keras_pendulum.errors import ConfigError

if TYPE_CHECKING:
    import gymnasium
    import numpy as np
    from numpy.typing import NDArray

    from keras_pendulum.environments.actions import Actions


class Task(ABC):
    """An environment of Gymnasium with its physics.

    A further task is a frozen dataclass in a module of its own. Its fields are the settings that
    change the physics, such as `gravity`.
    """

    environment: ClassVar[str]  # Gymnasium's name
    observation_names: ClassVar[tuple[str, ...]]  # D of them
    steps_per_episode: ClassVar[int]  # Gymnasium truncates an episode here
    never_terminates: ClassVar[bool]  # true where every episode has all its steps
    reward_range: ClassVar[tuple[float, float]]  # of one step
    seconds_per_step: ClassVar[float]
    weights_name: ClassVar[str]  # file name of a run's checkpoint
    usual_discount: ClassVar[float] = 0.99  # γ, for an agent that records none
    own_settings: ClassVar[tuple[str, ...]] = ()  # settings of a Config that only this task has
    curve_column: ClassVar[str] = "episode_return"  # of history.csv, for learning curves
    curve_label: ClassVar[str] = "Return (steps)"

    gravity: float | None = None  # m/s², where it can be chosen

    @property
    def observation_size(self) -> int:
        """The number of observed numbers D."""
        return len(self.observation_names)

    @property
    def name(self) -> str:
        """The environment and its physics; regrets of different tasks cannot be compared."""
        return self.environment

    @property
    def physics(self) -> dict[str, Any]:
        """The arguments of `gymnasium.make` for the physics."""
        return {}

    @abstractmethod
    def actions(self, count: int | None = None) -> Actions:
        """Returns the actions that the outputs of a network stand for.

        `count` is the number of outputs, where it can be chosen; None takes the usual one.
        """

    def action_count(self, count: int) -> int:
        """Returns how many outputs a network has; it is `count` where it can be chosen."""
        return self.actions(count).count

    def with_gravity(self, gravity: float | None) -> Self:
        """Returns the task with another gravity in m/s²; None keeps its own.

        Raises ConfigError where it has none, or for one out of range.
        """
        if gravity is None:
            return self
        raise ConfigError(f"gravity belongs to Pendulum-v1; {self.environment} has none")

    def curve_value(self, episode_return: float, steps: float) -> float:
        """Returns the return of an episode of so many steps as learning curves show it."""
        return episode_return

    def reset_to_angle(self, env: gymnasium.Env[Any, Any], angle: float) -> Any:
        """Sets an environment to rest at an angle, and returns the observation [D].

        Args:
            env: of this task; it was reset before.
            angle: in degrees counterclockwise from upright.

        Raises ConfigError where the start cannot be chosen.
        """
        raise ConfigError(
            f"--start belongs to Pendulum-v1; {self.environment} has none: use --seed"
        )

    def starts(self, seeds: Iterable[int]) -> NDArray[np.float64]:
        """Returns the states [N, S] of `reset(seed=…)` for N seeds, at least one.

        The environment has its state in the attribute `state`.
        """
        import numpy as np

        env: Any = self.make_env().unwrapped
        states = []
        for seed in seeds:
            env.reset(seed=seed)
            states.append(env.state)
        return np.array(states, np.float64)

    def make_env(
        self, render_mode: str | None = None, steps: int | None = None
    ) -> gymnasium.Env[Any, Any]:
        """Returns a new environment.

        Args:
            render_mode: Gymnasium's.
            steps: truncates an episode after so many steps; None takes Gymnasium's limit.

        Raises UserError for the render mode `human` without a display.
        """
        import gymnasium

        if render_mode == "human":
            require_display()

        # The checker costs time at every step, and Gymnasium's own environments pass it.
        return gymnasium.make(
            self.environment,
            max_episode_steps=steps or self.steps_per_episode,
            render_mode=render_mode,
            disable_env_checker=True,
            **self.physics,
        )
