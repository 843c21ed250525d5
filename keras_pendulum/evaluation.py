"""How good a network is: greedy returns from fixed starts, beside the best possible ones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from keras_pendulum.environment import make_environment
from keras_pendulum.network import DQN
from keras_pendulum.optimum import optimal_return
from keras_pendulum.policy import GreedyPolicy
from keras_pendulum.presets import checked_setting
from keras_pendulum.torque import TorqueGrid


@dataclass(frozen=True)
class Score:
    """Undiscounted returns of 200 steps, one an episode."""

    environment: str
    gravity: float  # m/s²
    returns: NDArray[np.float64]  # [episodes]
    optimal_returns: NDArray[np.float64]  # [episodes], best possible with the 41 torques

    @property
    def mean_return(self) -> float:
        """Mean over the starts."""
        return float(self.returns.mean())

    @property
    def std_return(self) -> float:
        """Standard deviation over the starts."""
        return float(self.returns.std())

    @property
    def median_return(self) -> float:
        """Median over the starts."""
        return float(np.median(self.returns))

    @property
    def worst_return(self) -> float:
        """Lowest of the starts."""
        return float(self.returns.min())

    @property
    def optimal_mean_return(self) -> float:
        """Mean of the best possible returns of the same starts."""
        return float(self.optimal_returns.mean())

    @property
    def regret(self) -> float:
        """Best possible mean return minus the achieved one."""
        return self.optimal_mean_return - self.mean_return

    def as_json(self) -> dict[str, Any]:
        """The figures that `evaluate --json` prints."""
        return {
            "environment": self.environment,
            "gravity": self.gravity,
            "episodes": len(self.returns),
            "mean_return": self.mean_return,
            "std_return": self.std_return,
            "median_return": self.median_return,
            "worst_return": self.worst_return,
            "optimal_mean_return": self.optimal_mean_return,
            "regret": self.regret,
        }

    def summary(self) -> str:
        """Three lines for people."""
        return (
            f"Greedy on {len(self.returns)} fixed starts, {self.environment}, g = {self.gravity:g}"
            f": mean return {self.mean_return:.2f} (standard deviation {self.std_return:.2f}, "
            f"median {self.median_return:.2f}, worst {self.worst_return:.2f})\n"
            f"Best possible on the same starts: {self.optimal_mean_return:.2f}\n"
            f"Regret: {self.regret:.2f}"
        )


def evaluate_policy(
    network: DQN,
    episodes: int = 100,
    seed: int = 0,
    *,
    gravity: float | None = None,
    render_mode: str | None = None,
    on_step: Callable[[gymnasium.Env[Any, Any]], None] = lambda env: None,
) -> Score:
    """Greedy episodes; episode i starts from `reset(seed=seed+i)`.

    Args:
        network: the Q-network; its number of outputs makes the torque grid.
        episodes: how many.
        seed: of the first start.
        gravity: m/s²; None takes the network's own, or 1 where that is not known.
        render_mode: Gymnasium's, for watching.
        on_step: called with the environment after each reset and each step.

    Raises ConfigError for numbers no evaluation can have.
    """
    episodes = checked_setting("episodes", episodes)
    seed = checked_setting("seed", seed)
    checked_setting("seed", seed + episodes - 1)
    if gravity is None:
        gravity = 1.0 if network.origin.gravity is None else network.origin.gravity
    gravity = checked_setting("gravity", gravity)
    env = make_environment(network.origin.environment, gravity, render_mode)
    policy = GreedyPolicy(network)
    torques = TorqueGrid(network.action_count)
    seeds = range(seed, seed + episodes)

    def act(observation: NDArray[np.float32]) -> NDArray[np.float64]:
        return torques.torque(policy.action(observation))

    returns = [_episode_return(env, start, act, on_step) for start in seeds]
    env.close()
    return Score(
        network.origin.environment, gravity, np.array(returns), optimal_return(gravity, seeds)
    )


@cache
def random_return(environment: str, gravity: float, episodes: int = 100) -> float:
    """Mean return of uniformly random torques from the starts of seeds 0, 1, …: the floor."""
    env = make_environment(environment, gravity)
    torques = TorqueGrid()
    random = np.random.RandomState(0)

    def act(observation: NDArray[np.float32]) -> NDArray[np.float64]:
        return torques.torque(random.randint(torques.count))

    returns = [_episode_return(env, start, act) for start in range(episodes)]
    return float(np.mean(returns))


def _episode_return(
    env: gymnasium.Env[Any, Any],
    seed: int,
    act: Callable[[NDArray[np.float32]], NDArray[np.float64]],
    on_step: Callable[[gymnasium.Env[Any, Any]], None] = lambda env: None,
) -> float:
    observation, _ = env.reset(seed=seed)
    on_step(env)
    total = 0.0
    over = False
    while not over:
        observation, reward, terminated, truncated, _ = env.step(act(observation))
        on_step(env)
        total += float(reward)
        over = terminated or truncated
    return total
