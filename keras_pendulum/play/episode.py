"""An episode of the pendulum that a caller plays one torque at a time."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.environments.torque import require_torque

if TYPE_CHECKING:
    import gymnasium


class ManualEpisode:
    """One episode of the pendulum from the start `reset(seed=seed)`."""

    def __init__(self, env: gymnasium.Env[Any, Any], seed: int) -> None:
        self._env = env
        self.observation: NDArray[np.float32] = env.reset(seed=seed)[0]  # [3]
        self.torque = 0.0  # N·m, of the last step
        self.steps = 0
        self.reward = 0.0  # of the last step
        self.total_reward = 0.0  # the undiscounted return so far
        self.done = False
        self.path = [self.state]  # of the phase plane, from the start on

    @property
    def state(self) -> tuple[float, float]:
        """The angle θ in rad, -π to π and 0 upright, and the speed θ̇ in rad/s."""
        cosine, sine, speed = map(float, self.observation)
        return math.atan2(sine, cosine), speed

    def step(self, torque: float) -> None:
        """Takes one step. Raises ValueError for a torque that is not finite or outside ±2 N·m."""
        # The environment would clip a larger torque, and its state would stay NaN after a NaN.
        require_torque(torque)
        self.observation, reward, terminated, truncated, _ = self._env.step(np.array([torque]))
        self.torque, self.reward = torque, float(reward)
        self.total_reward += self.reward
        self.steps += 1
        self.path.append(self.state)
        self.done = terminated or truncated

    def __str__(self) -> str:
        return (
            f"Step: {self.steps}, Torque: {self.torque:g}, Reward: {self.reward:.3f}, "
            f"Return: {self.total_reward:.3f}"
        )
