"""The pendulum: Gymnasium's `Pendulum-v1` at any gravity."""

from __future__ import annotations

import math
import numbers
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from keras_pendulum.environments.task import Task
from keras_pendulum.environments.torque import MAX_TORQUE
from keras_pendulum.errors import ConfigError

if TYPE_CHECKING:
    import gymnasium
    import numpy as np
    from numpy.typing import NDArray

    from keras_pendulum.environments.actions import TorqueGrid

STEPS_PER_EPISODE = 200
MAX_SPEED = 8.0  # rad/s
LARGEST_GRAVITY = 100.0  # m/s²


@dataclass(frozen=True)
class Pendulum(Task):
    """A pendulum that a torque swings up. It never terminates.

    The state is [θ in rad, θ̇ in rad/s], θ = 0 upright. The observation is [cos θ, sin θ, θ̇]. The
    action is [u], a torque in N·m. The reward is -(θ² + 0.1 θ̇² + 0.001 u²). Raises ConfigError for
    a gravity out of range.
    """

    gravity: float = 1.0  # m/s², 0 to 100; Gymnasium's own default is 10

    environment: ClassVar[str] = "Pendulum-v1"
    observation_names: ClassVar[tuple[str, ...]] = ("cos θ", "sin θ", "θ̇")
    steps_per_episode: ClassVar[int] = STEPS_PER_EPISODE
    never_terminates: ClassVar[bool] = True
    reward_range: ClassVar[tuple[float, float]] = (
        -(math.pi**2 + 0.1 * MAX_SPEED**2 + 0.001 * MAX_TORQUE**2),
        0.0,
    )
    seconds_per_step: ClassVar[float] = 0.05
    weights_name: ClassVar[str] = "pendulum_weight.h5"
    usual_discount: ClassVar[float] = 0.9
    own_settings: ClassVar[tuple[str, ...]] = ("gravity", "torque_count", "stored_index")
    curve_column: ClassVar[str] = "average_reward"
    curve_label: ClassVar[str] = "Reward per step"

    def __post_init__(self) -> None:
        object.__setattr__(self, "gravity", validate_gravity(self.gravity))

    @property
    def name(self) -> str:
        """The environment and its gravity."""
        return f"{self.environment}, g = {self.gravity:g}"

    @property
    def physics(self) -> dict[str, Any]:
        """The gravity."""
        return {"g": self.gravity}

    def actions(self, count: int | None = None) -> TorqueGrid:
        """Returns `count` evenly spaced torques; None stands for 41."""
        from keras_pendulum.environments.actions import TorqueGrid

        return TorqueGrid(count or 41)

    def action_count(self, count: int) -> int:
        """Returns the number of torques."""
        return count

    def with_gravity(self, gravity: float | None) -> Pendulum:
        """Returns the pendulum with another gravity. Raises ConfigError for one out of range."""
        return self if gravity is None else Pendulum(gravity)

    def curve_value(self, episode_return: float, steps: float) -> float:
        """Returns the reward per step."""
        return episode_return / steps

    def reset_to_angle(self, env: gymnasium.Env[Any, Any], angle: float) -> NDArray[np.float32]:
        """Sets the pendulum to rest at an angle in degrees; returns the observation [3]."""
        import numpy as np

        theta = math.radians(angle)
        env.unwrapped.state = np.array([theta, 0.0])  # type: ignore[attr-defined]
        return np.array([math.cos(theta), math.sin(theta), 0.0], np.float32)


def validate_gravity(gravity: float) -> float:
    """Returns the gravity in m/s² as a float. Raises ConfigError unless it is 0 to 100."""
    is_number = isinstance(gravity, numbers.Real) and not isinstance(gravity, bool)
    if not is_number or not 0 <= gravity <= LARGEST_GRAVITY:  # written so that NaN fails too
        found = repr(gravity)[:50]
        raise ConfigError(f"gravity is {found}; expected a number from 0 to 100 (m/s²)")
    return float(gravity) + 0.0  # -0.0 becomes 0.0
