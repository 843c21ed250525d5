"""Evaluation: greedy returns from fixed starts, compared with the optimum of each start."""

from __future__ import annotations

import contextlib
import math
import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from keras_pendulum.config.config import Config
from keras_pendulum.config.settings import validate_setting
from keras_pendulum.dqn.network import DQN, Provenance
from keras_pendulum.environments.actions import make_actions
from keras_pendulum.environments.tasks import TASKS, make_environment, pendulum_starts
from keras_pendulum.errors import ConfigError, require_type
from keras_pendulum.evaluate.loaded_policy import Policy, load_policy
from keras_pendulum.optimum.dynamics import TORQUES, simulate_return
from keras_pendulum.optimum.optimal_return import USUAL_SEEDS, optimal_return


@dataclass(frozen=True)
class Score:
    """The undiscounted returns of whole episodes."""

    environment: str
    gravity: float | None  # m/s²; None for CartPole
    returns: NDArray[np.float64]  # [episodes]
    optimal_returns: NDArray[np.float64]  # [episodes]; with 41 torques; 500 for CartPole

    @property
    def mean_return(self) -> float:
        """The mean over the starts."""
        return float(self.returns.mean())

    @property
    def std_return(self) -> float:
        """The standard deviation over the starts."""
        return float(self.returns.std())

    @property
    def median_return(self) -> float:
        """The median over the starts."""
        return float(np.median(self.returns))

    @property
    def worst_return(self) -> float:
        """The lowest return."""
        return float(self.returns.min())

    @property
    def optimal_mean_return(self) -> float:
        """The mean optimal return of the same starts."""
        return float(self.optimal_returns.mean())

    @property
    def regret(self) -> float:
        """The mean optimal return minus the mean return."""
        return self.optimal_mean_return - self.mean_return

    def as_json(self) -> dict[str, Any]:
        """Returns the object that `evaluate --json` prints."""
        # Programs that read this object expect null for CartPole in the last two.
        pendulum = TASKS[self.environment].has_torque
        return {
            "environment": self.environment,
            "gravity": self.gravity,
            "episodes": len(self.returns),
            "mean_return": self.mean_return,
            "std_return": self.std_return,
            "median_return": self.median_return,
            "worst_return": self.worst_return,
            "optimal_mean_return": self.optimal_mean_return if pendulum else None,
            "regret": self.regret if pendulum else None,
        }

    def summary(self) -> str:
        """Returns the three lines that `evaluate` prints."""
        gravity = "" if self.gravity is None else f", g = {self.gravity:g}"
        return (
            f"Greedy on {len(self.returns)} fixed starts, {self.environment}{gravity}"
            f": mean return {self.mean_return:.2f} (standard deviation {self.std_return:.2f}, "
            f"median {self.median_return:.2f}, worst {self.worst_return:.2f})\n"
            f"Best possible on the same starts: {self.optimal_mean_return:.2f}\n"
            f"Regret: {self.regret:.2f}"
        )


def evaluate_policy(
    agent: DQN | Policy | str | os.PathLike[str],
    episodes: int = 100,
    seed: int = 0,
    *,
    gravity: float | None = None,
    render_mode: str | None = None,
    on_step: Callable[[gymnasium.Env[Any, Any]], None] = lambda env: None,
) -> Score:
    """Returns the score of greedy episodes; episode i starts from `reset(seed=seed+i)`.

    Args:
        agent: a network, its policy, or the path or shipped name of its weights file.
        episodes: number of episodes.
        seed: seed of the first start.
        gravity: m/s², for the pendulum; None takes the agent's recorded gravity, else 1.
        render_mode: Gymnasium's.
        on_step: called with the environment after each reset and each step.

    Raises ConfigError for a number out of range, and for a gravity with CartPole. Raises UserError
    when a weight is not finite, WeightsError as `load_weights` does, and TypeError for another
    agent.
    """
    require_type("agent", agent, (DQN, Policy, str, os.PathLike))
    if isinstance(agent, (str, os.PathLike)):
        agent = load_policy(agent)
    policy = agent if isinstance(agent, Policy) else Policy(agent)
    episodes = validate_setting("episodes", episodes)
    seed = validate_setting("seed", seed)
    validate_setting("seed", seed + episodes - 1)
    environment = policy.provenance.environment
    gravity = evaluation_gravity(policy.provenance, gravity)
    seeds = range(seed, seed + episodes)

    def act(observation: NDArray[np.float32]) -> Any:
        return policy.actions.to_env_action(policy.greedy.action(observation))

    with contextlib.closing(make_environment(environment, gravity, render_mode)) as env:
        returns = [_episode_return(env, start, act, on_step) for start in seeds]
    if gravity is None:
        optimum = np.full(episodes, TASKS[environment].optimal_return)
    else:
        optimum = optimal_return(gravity, seeds)
    return Score(environment, gravity, np.array(returns), optimum)


def evaluation_gravity(provenance: Provenance, gravity: float | None = None) -> float | None:
    """Returns the gravity (m/s²) to evaluate a network at; None for CartPole.

    It is `gravity`, else the recorded one, else 1. Raises ConfigError for a gravity out of range,
    and for any gravity on CartPole.
    """
    if not TASKS[provenance.environment].has_torque:
        if gravity is not None:
            raise ConfigError(f"gravity belongs to Pendulum-v1; {provenance.environment} has none")
        return None
    for candidate in (gravity, provenance.gravity):
        if candidate is not None:
            return float(validate_setting("gravity", candidate))
    return Config.gravity


def optimal_training_return(config: Config) -> float:
    """Returns the mean optimal return of a training episode; NaN for a pendulum beyond 200 steps.

    For the pendulum it is the mean over seeds 0 to 999. CartPole's reward is 1 per step.
    """
    if config.gravity is None:
        return float(config.max_episode_steps)
    if config.max_episode_steps > TASKS[config.environment].steps_per_episode:
        return math.nan
    return float(optimal_return(config.gravity, USUAL_SEEDS, config.max_episode_steps).mean())


@cache
def random_return(
    environment: str, gravity: float | None, steps: int, episodes: int = 100
) -> float:
    """Returns the mean return of uniformly random actions from the starts of seeds 0, 1, ….

    Args:
        environment: Gymnasium's name.
        gravity: m/s²; None for CartPole.
        steps: an episode is truncated after so many steps.
        episodes: number of episodes.
    """
    random = np.random.RandomState(0)
    if gravity is not None:  # simulating all episodes in one array is 20 times as fast as a loop
        torques = random.randint(len(TORQUES), size=(episodes, steps))
        starts = pendulum_starts(range(episodes))
        returns = simulate_return(lambda step, *_: torques[:, step], steps, gravity, starts)
        return float(returns.mean())
    env = make_environment(environment, gravity, steps=steps)
    actions = make_actions(environment, len(TORQUES))

    def act(observation: NDArray[np.float32]) -> Any:
        return actions.to_env_action(random.randint(actions.count))

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
    done = False
    while not done:
        observation, reward, terminated, truncated, _ = env.step(act(observation))
        on_step(env)
        total += float(reward)
        done = terminated or truncated
    return total
