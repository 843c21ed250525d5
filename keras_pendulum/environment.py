"""The environments: what this package knows of them, and Gymnasium's own beneath."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import gymnasium
    import numpy as np
    from numpy.typing import NDArray

STEPS_PER_EPISODE = 200  # Pendulum-v1 truncates here and never terminates


@dataclass(frozen=True)
class Task:
    """What the package needs to know of an environment before it makes one."""

    observation_size: int
    steps_per_episode: int  # where Gymnasium truncates
    never_terminates: bool
    action_count: (
        int | None
    )  # of Gymnasium's own actions; None where a torque acts, under a gravity
    weights_name: str  # of a run's checkpoint
    seconds_per_step: float

    @property
    def has_torque(self) -> bool:
        """Whether it is the pendulum, with torques and a gravity to choose."""
        return self.action_count is None


TASKS = {
    # Observation [cos θ, sin θ, θ̇ in rad/s], θ = 0 upright; an action [1] is a torque in N·m;
    # reward -(θ² + 0.1 θ̇² + 0.001 u²).
    "Pendulum-v1": Task(3, STEPS_PER_EPISODE, True, None, "pendulum_weight.h5", 0.05),
    # Observation [x in m, ẋ in m/s, θ in rad, θ̇ in rad/s], θ = 0 upright; action 0 pushes left, 1
    # right; reward 1 a step until |θ| > 12° or |x| > 2.4 m terminates.
    "CartPole-v1": Task(4, 500, False, 2, "cartpole_weight.h5", 0.02),
}


def make_environment(
    environment: str,
    gravity: float | None,
    render_mode: str | None = None,
    steps: int | None = None,
) -> gymnasium.Env[Any, Any]:
    """An environment of TASKS, with the pendulum's gravity in m/s² (None for CartPole).

    It truncates after `steps` steps, or where Gymnasium does.
    """
    import gymnasium

    physics = {} if gravity is None else {"g": gravity}
    # The checker wraps every step and finds nothing in an environment of Gymnasium's own.
    return gymnasium.make(
        environment,
        max_episode_steps=steps or TASKS[environment].steps_per_episode,
        render_mode=render_mode,
        disable_env_checker=True,
        **physics,
    )


def pendulum_starts(seeds: Iterable[int]) -> NDArray[np.float64]:
    """The states [N, 2], θ in rad and θ̇ in rad/s, that `reset(seed=…)` draws for the seeds [N]."""
    import numpy as np

    env = make_environment("Pendulum-v1", gravity=1.0).unwrapped
    states = []
    for seed in seeds:
        env.reset(seed=seed)
        states.append(env.state)  # type: ignore[attr-defined]
    return np.array(states, np.float64).reshape(-1, 2)


def snapshot(env: gymnasium.Env[Any, Any]) -> Callable[[], None]:
    """What, called later, brings an environment of TASKS back to where it stands now.

    Good for steps, not for resets: steps of these environments draw nothing and replace what they
    change, so that the values of the attributes suffice.
    """
    layers = [env]
    while layers[-1] is not env.unwrapped:
        layers.append(layers[-1].env)  # type: ignore[attr-defined]
    states = [(layer, dict(vars(layer))) for layer in layers]

    def go_back() -> None:
        for layer, state in states:
            vars(layer).update(state)

    return go_back
