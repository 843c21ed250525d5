"""The environment: Gymnasium's inverted pendulum."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import gymnasium

STEPS_PER_EPISODE = 200  # Pendulum-v1 truncates here and never terminates


def make_environment(
    environment: str, gravity: float, render_mode: str | None = None, steps: int = STEPS_PER_EPISODE
) -> gymnasium.Env[Any, Any]:
    """Pendulum-v1 with its gravity in m/s², truncated after `steps` steps.

    Observations [3] are [cos θ, sin θ, θ̇ in rad/s] (θ = 0 upright), an action [1] is a torque in
    N·m, and a reward is -(θ² + 0.1 θ̇² + 0.001 u²).
    """
    import gymnasium

    # The checker wraps every step and finds nothing in an environment of Gymnasium's own.
    return gymnasium.make(
        environment,
        max_episode_steps=steps,
        g=gravity,
        render_mode=render_mode,
        disable_env_checker=True,
    )
