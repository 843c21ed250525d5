"""An episode of the pendulum, driven a step at a time by whoever it may be."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from keras_pendulum.torque import MAX_TORQUE

Policy = Callable[[NDArray[np.float32]], float]  # observation [3] -> torque in N·m


class Drive:
    """One episode of a pendulum from the start `reset(seed=seed)`, a torque at a time."""

    def __init__(self, env: gymnasium.Env[Any, Any], seed: int) -> None:
        self._env = env
        self.observation: NDArray[np.float32] = env.reset(seed=seed)[0]  # [3]
        self.torque = 0.0  # N·m, of the last step
        self.steps = 0
        self.reward = 0.0  # of the last step
        self.total = 0.0  # the undiscounted return so far
        self.over = False

    def step(self, torque: float) -> None:
        """One step under `torque`; ValueError where it is not finite or outside ±2 N·m."""
        # The environment would clip what is too large, and never recover from a NaN.
        if not abs(torque) <= MAX_TORQUE:  # written so that NaN fails too
            raise ValueError(f"torque {torque} N·m; expected a number from -2 to 2")
        self.observation, reward, terminated, truncated, _ = self._env.step(np.array([torque]))
        self.torque, self.reward = torque, float(reward)
        self.total += self.reward
        self.steps += 1
        self.over = terminated or truncated

    def __str__(self) -> str:
        return (
            f"Step: {self.steps}, Torque: {self.torque:g}, Reward: {self.reward:.3f}, "
            f"Return: {self.total:.3f}"
        )
