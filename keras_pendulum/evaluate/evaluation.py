"""Evaluation: greedy returns from fixed starts, compared with the optimum of each start."""

from __future__ import annotations

import math
from functools import cache, partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from keras_pendulum.config.config import Config
from keras_pendulum.config.settings import validate_setting
from keras_pendulum.dqn.network import Provenance
from keras_pendulum.environments.actions import make_actions
from keras_pendulum.environments.tasks import TASKS, make_environment, pendulum_starts
from keras_pendulum.errors import ConfigError
from keras_pendulum.evaluate.agents import as_agent
from keras_pendulum.evaluate.episodes import OnStep, episode_return, episode_returns
from keras_pendulum.evaluate.score import Score
from keras_pendulum.optimum.discounted import validate_discount
from keras_pendulum.optimum.dynamics import TORQUES, simulate_return
from keras_pendulum.optimum.optimal_return import USUAL_SEEDS, optimal_return


def evaluate_policy(
    agent: Any,
    episodes: int = 100,
    seed: int = 0,
    *,
    gravity: float | None = None,
    discount: float | None = None,
    torques: ArrayLike | None = None,
    render_mode: str | None = None,
    on_step: OnStep | None = None,
) -> Score:
    """Returns the score of greedy episodes; episode i starts from `reset(seed=seed+i)`.

    Args:
        agent: a network, its policy, the path or shipped name of its file, a Keras model, a
            function from observation to torque, a `q_function`, or an object with `predict`.
        episodes: number of episodes.
        seed: seed of the first start.
        gravity: m/s², for the pendulum; None takes the agent's recorded gravity, else 1.
        discount: γ that the agent learned with; None takes the recorded one, if there is one.
        torques: N·m, what the agent's outputs stand for; None takes `linspace(-2, 2, A)`.
        render_mode: Gymnasium's.
        on_step: called with the environment after each reset and each step.

    Raises ConfigError for a number out of range, and for a gravity, a discount or torques that the
    agent cannot have. Raises UserError when a weight is not finite, and for an answer that is no
    torque, with its episode and step. Raises WeightsError as `load_weights` does, and TypeError for
    another agent.

    >>> score = kp.evaluate_policy("reference", episodes=10)
    >>> score.returns.shape, score.regret < 5
    ((10,), True)
    """
    agent = as_agent(agent, torques)
    episodes = validate_setting("episodes", episodes)
    seed = validate_setting("seed", seed)
    validate_setting("seed", seed + episodes - 1)
    environment = agent.environment
    gravity = evaluation_gravity(agent.provenance or Provenance(), gravity)
    if discount is None:
        discount = agent.discount
    elif gravity is None:
        raise ConfigError(f"discount belongs to Pendulum-v1; {environment} has no exact solution")
    else:
        discount = validate_discount(discount)
    seeds = range(seed, seed + episodes)
    make = partial(make_environment, environment, gravity, render_mode)
    watched = render_mode is not None or on_step is not None
    returns = episode_returns(agent, make, seeds, on_step, one_by_one=watched)
    if gravity is None:
        return Score(
            environment, None, returns, np.full(episodes, TASKS[environment].optimal_return)
        )
    optimum = optimal_return(gravity, seeds)
    return Score(environment, gravity, returns, optimum, discount, seeds)


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

    return float(np.mean([episode_return(env, start, act) for start in range(episodes)]))
