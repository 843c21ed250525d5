"""The two tasks of this package, and their Gymnasium environments."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import gymnasium
    import numpy as np
    from numpy.typing import NDArray

STEPS_PER_EPISODE = 200  # Pendulum-v1 truncates here and never terminates


@dataclass(frozen=True)
class Task:
    """Properties of an environment that are needed before it is made."""

    observation_size: int  # D
    steps_per_episode: int  # Gymnasium truncates an episode here
    never_terminates: bool
    action_count: int | None  # None for the pendulum, which takes a torque
    optimal_return: float | None  # None for the pendulum: the room `optimum` computes it
    weights_name: str  # file name of a run's checkpoint
    seconds_per_step: float

    @property
    def has_torque(self) -> bool:
        """True for the pendulum, which has torques and a gravity."""
        return self.action_count is None


TASKS = {
    # Observation [cos θ, sin θ, θ̇ in rad/s], θ = 0 upright. Action [1]: a torque u in N·m. Reward
    # -(θ² + 0.1 θ̇² + 0.001 u²).
    "Pendulum-v1": Task(3, STEPS_PER_EPISODE, True, None, None, "pendulum_weight.h5", 0.05),
    # Observation [x in m, ẋ in m/s, θ in rad, θ̇ in rad/s], θ = 0 upright. Action 0 pushes left, 1
    # right. Reward 1 per step until |θ| > 12° or |x| > 2.4 m terminates the episode.
    "CartPole-v1": Task(4, 500, False, 2, 500.0, "cartpole_weight.h5", 0.02),
}


def task_name(environment: str, gravity: float | None) -> str:
    """Returns the environment and its gravity; regrets of different tasks cannot be compared."""
    return environment if gravity is None else f"{environment}, g = {gravity:g}"


def make_environment(
    environment: str,
    gravity: float | None,
    render_mode: str | None = None,
    steps: int | None = None,
) -> gymnasium.Env[Any, Any]:
    """Returns an environment of TASKS.

    Args:
        environment: Gymnasium's name.
        gravity: of the pendulum in m/s²; None for CartPole.
        render_mode: Gymnasium's.
        steps: truncates an episode after so many steps; None takes Gymnasium's limit.
    """
    import gymnasium

    physics = {} if gravity is None else {"g": gravity}
    # The checker costs time at every step, and Gymnasium's own environments pass it.
    return gymnasium.make(
        environment,
        max_episode_steps=steps or TASKS[environment].steps_per_episode,
        render_mode=render_mode,
        disable_env_checker=True,
        **physics,
    )


def pendulum_starts(seeds: Iterable[int]) -> NDArray[np.float64]:
    """Returns the states [N, 2] (θ in rad, θ̇ in rad/s) of `reset(seed=…)` for N seeds."""
    import numpy as np

    env = make_environment("Pendulum-v1", gravity=1.0).unwrapped
    states = []
    for seed in seeds:
        env.reset(seed=seed)
        states.append(env.state)  # type: ignore[attr-defined]
    return np.array(states, np.float64).reshape(-1, 2)
