"""How good a network is: greedy returns from fixed starts, beside the best possible ones."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from keras_pendulum.actions import make_actions
from keras_pendulum.config import Config, checked_setting
from keras_pendulum.environment import TASKS, make_environment, pendulum_starts
from keras_pendulum.errors import ConfigError
from keras_pendulum.network import DQN
from keras_pendulum.optimum import USUAL_SEEDS, optimal_return
from keras_pendulum.policy import GreedyPolicy
from keras_pendulum.value_tables import TORQUES, exact_return


@dataclass(frozen=True)
class Score:
    """Undiscounted returns of whole episodes."""

    environment: str
    gravity: float | None  # m/s², the pendulum's
    returns: NDArray[np.float64]  # [episodes]
    optimal_returns: NDArray[np.float64]  # [episodes], best possible with 41 torques; or NaN

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
        """Mean of the best possible returns of the same starts; NaN for CartPole."""
        return float(self.optimal_returns.mean())

    @property
    def regret(self) -> float:
        """Best possible mean return minus the achieved one; NaN for CartPole."""
        return self.optimal_mean_return - self.mean_return

    def as_json(self) -> dict[str, Any]:
        """The figures that `evaluate --json` prints."""
        unknown = math.isnan(self.regret)
        return {
            "environment": self.environment,
            "gravity": self.gravity,
            "episodes": len(self.returns),
            "mean_return": self.mean_return,
            "std_return": self.std_return,
            "median_return": self.median_return,
            "worst_return": self.worst_return,
            "optimal_mean_return": None if unknown else self.optimal_mean_return,
            "regret": None if unknown else self.regret,
        }

    def summary(self) -> str:
        """Three lines for people, or two for CartPole."""
        gravity = "" if self.gravity is None else f", g = {self.gravity:g}"
        text = (
            f"Greedy on {len(self.returns)} fixed starts, {self.environment}{gravity}"
            f": mean return {self.mean_return:.2f} (standard deviation {self.std_return:.2f}, "
            f"median {self.median_return:.2f}, worst {self.worst_return:.2f})\n"
        )
        if math.isnan(self.regret):
            return f"{text}Highest possible: {TASKS[self.environment].steps_per_episode}"
        return (
            f"{text}Best possible on the same starts: {self.optimal_mean_return:.2f}\n"
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
        gravity: m/s², the pendulum's; None takes the network's own, or 1 where that is not known.
        render_mode: Gymnasium's, for watching.
        on_step: called with the environment after each reset and each step.

    Raises ConfigError for numbers no evaluation can have.
    """
    episodes = checked_setting("episodes", episodes)
    seed = checked_setting("seed", seed)
    checked_setting("seed", seed + episodes - 1)
    environment = network.origin.environment
    if TASKS[environment].has_torque:
        known = 1.0 if network.origin.gravity is None else network.origin.gravity
        gravity = checked_setting("gravity", known if gravity is None else gravity)
    elif gravity is not None:
        raise ConfigError(f"gravity belongs to Pendulum-v1; {environment} has none to set")
    env = make_environment(environment, gravity, render_mode)
    policy = GreedyPolicy(network)
    actions = make_actions(environment, network.action_count)
    seeds = range(seed, seed + episodes)

    def act(observation: NDArray[np.float32]) -> Any:
        return actions.control(policy.action(observation))

    with contextlib.closing(env):
        returns = [_episode_return(env, start, act, on_step) for start in seeds]
    best = np.full(episodes, np.nan) if gravity is None else optimal_return(gravity, seeds)
    return Score(environment, gravity, np.array(returns), best)


def best_training_return(config: Config) -> float:
    """The best possible mean return of a training episode; NaN where that is not known.

    It is known for the pendulum up to Gymnasium's own 200 steps. CartPole earns 1 a step.
    """
    if config.gravity is None:
        return float(config.episode_steps)
    if config.episode_steps > TASKS[config.environment].steps_per_episode:
        return math.nan
    return float(optimal_return(config.gravity, USUAL_SEEDS, config.episode_steps).mean())


@cache
def random_return(
    environment: str, gravity: float | None, steps: int, episodes: int = 100
) -> float:
    """Mean return of uniformly random actions from the starts of seeds 0, 1, …: the floor.

    The episodes have `steps` steps at most.
    """
    random = np.random.RandomState(0)
    if gravity is not None:  # all pendulums at once, 20 times as fast as one after the other
        torques = random.randint(len(TORQUES), size=(episodes, steps))
        starts = pendulum_starts(range(episodes))
        returns = exact_return(lambda step, *_: torques[:, step], steps, gravity, starts)
        return float(returns.mean())
    env = make_environment(environment, gravity, steps=steps)
    actions = make_actions(environment, None)

    def act(observation: NDArray[np.float32]) -> Any:
        return actions.control(random.randint(actions.count))

    return float(np.mean([_episode_return(env, start, act) for start in range(episodes)]))


def _episode_return(
    env: gymnasium.Env[Any, Any],
    seed: int,
    act: Callable[[NDArray[np.float32]], Any],
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
