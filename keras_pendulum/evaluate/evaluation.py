"""Evaluation: greedy returns from fixed starts, compared with the optimum of each start."""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Callable, Sequence
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import ArrayLike, NDArray

from keras_pendulum.config.fields import Integer, Number
from keras_pendulum.environments.pendulum import Pendulum
from keras_pendulum.environments.task import Task
from keras_pendulum.errors import ConfigError, UserError
from keras_pendulum.evaluate.answers import ActionError
from keras_pendulum.evaluate.policy import Policy
from keras_pendulum.evaluate.score import Score
from keras_pendulum.evaluate.sources import as_policy
from keras_pendulum.optimum.solutions import solution
from keras_pendulum.status import Report

Env = gymnasium.Env[Any, Any]
OnStep = Callable[[Env], None]
USUAL_GRAVITIES = (10.0, 1.0)  # m/s², Gymnasium's default and that of the presets
_SIDE_BY_SIDE = 100  # episodes
_STARTS_OF_A_TRIAL = 5


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
    on_progress: Report = lambda share: None,
) -> Score:
    """Returns the score of greedy episodes; episode i starts from `reset(seed=seed+i)`.

    Args:
        agent: a network, its policy, the path or shipped name of its file, a run folder, a Keras
            model, a function from an observation to a torque in N·m or to an index of `torques`, a
            `q_function`, or an object with `predict`.
        episodes: number of episodes.
        seed: seed of the first start.
        gravity: m/s², for the pendulum; None takes the agent's recorded gravity, else the better
            one of 10 and 1, and the summary says so.
        discount: γ that the agent learned with; None takes the recorded one, if there is one.
        torques: N·m, what the agent's outputs or indices stand for; None takes
            `linspace(-2, 2, A)` for outputs.
        render_mode: Gymnasium's.
        on_step: called with the environment after each reset and each step.
        on_progress: called at each step with the share of all steps that is done, 0 to 1.

    Raises ConfigError for a number out of range, and for a gravity, a discount or torques that the
    agent cannot have. Raises UserError when a weight is not finite, and for an answer that is not a
    torque, with its episode and step. Raises WeightsError as `load_weights` does, and TypeError for
    another agent.

    >>> score = kp.evaluate_policy("reference", episodes=10)
    >>> score.returns.shape, score.regret < 5
    ((10,), True)
    """
    policy = as_policy(agent, torques)
    episodes = Integer(1, 1_000_000).validate("episodes", episodes)
    seed = Integer(0, 2**32 - episodes).validate("seed", seed)
    task, assumption = find_task(policy, gravity)
    if discount is None:
        discount = policy.info.discount
    elif not task.has_exact_values:
        raise ConfigError(
            f"discount belongs to Pendulum-v1; {task.environment} has no exact solution"
        )
    else:
        discount = Number(0, 1).validate("discount", discount)
    seeds = range(seed, seed + episodes)
    returns = _play(policy, task, seeds, render_mode, on_step, on_progress)
    best = solution(task).best_returns(seeds)
    return Score(task, returns, best, discount, seeds, assumption)


def find_task(policy: Policy, gravity: float | None) -> tuple[Task, str]:
    """Returns the task of a policy, and a sentence where it is assumed or not the recorded one.

    For a policy that records no task, without a declared gravity in m/s², it is the usual one at
    which the policy gains most of what can be gained over random torques.

    Raises ConfigError for a gravity out of range, or where the task has none.
    """
    recorded = policy.info.task
    if recorded is not None or gravity is not None:
        task = policy.task.with_gravity(gravity)
        if recorded in (None, task):
            return task, ""
        return task, f"The agent records {recorded.name}, and is evaluated on {task.name}"
    seeds = range(_STARTS_OF_A_TRIAL)
    gained = {}
    for task in map(Pendulum, USUAL_GRAVITIES):
        exact = solution(task)
        random, best = exact.random_return(), float(exact.best_returns(seeds).mean())
        gained[task] = (float(_play(policy, task, seeds).mean()) - random) / (best - random)
    first, second = sorted(gained, key=lambda task: gained[task], reverse=True)
    return first, (
        f"The agent records no gravity. It gains {gained[first]:.0%} of what can be gained over "
        f"random torques at g = {first.gravity:g}, and {gained[second]:.0%} at g = "
        f"{second.gravity:g}: declare yours with gravity= (--gravity)"
    )


def _play(
    policy: Policy,
    task: Task,
    seeds: range,
    render_mode: str | None = None,
    on_step: OnStep | None = None,
    on_progress: Report = lambda share: None,
) -> NDArray[np.float64]:
    """Returns the undiscounted returns of the episodes from these seeds."""
    # One episode after the other where it is watched, or the policy needs it. Otherwise the policy
    # gets the observations of many episodes of the same length in one call.
    episodes = len(seeds)
    alone = policy.one_by_one or render_mode is not None or on_step is not None
    count = 1 if alone else min(_SIDE_BY_SIDE, episodes)

    def report(first: int, step: int) -> None:
        on_progress((first + count * step / task.steps_per_episode) / episodes)

    with contextlib.ExitStack() as stack:
        envs = [
            stack.enter_context(contextlib.closing(task.make_env(render_mode)))
            for _ in range(count)
        ]
        return np.concatenate(
            [
                _returns(policy, envs, seeds[first : first + count], first, on_step, report)
                for first in range(0, episodes, count)
            ]
        )


def _returns(
    policy: Policy,
    envs: Sequence[Env],
    seeds: range,
    first: int,
    on_step: OnStep | None,
    report: Callable[[int, int], None],
) -> NDArray[np.float64]:
    """Returns the undiscounted return of an episode for each seed, in environments of their own.

    `report` is called with `first` and the step.

    Raises UserError for an answer that is not an action, with its step and the number of its
    episode, which is `first` for the first seed.
    """
    envs = envs[: len(seeds)]
    observations = [env.reset(seed=seed)[0] for env, seed in zip(envs, seeds, strict=True)]
    policy.reset()
    if on_step:
        on_step(envs[0])
    returns = np.zeros(len(envs))
    for step in itertools.count():
        try:
            if len(envs) == 1:
                actions: Any = [policy.action(observations[0])]
            else:
                actions = policy.act(np.stack(observations))  # [B, ...]
        except ActionError as error:
            raise UserError(f"episode {first + error.row}, step {step}: {error}") from error
        for row, env in enumerate(envs):
            observations[row], reward, terminated, truncated, _ = env.step(actions[row])
            returns[row] += float(reward)
            if on_step:
                on_step(env)
        report(first, step)
        if terminated or truncated:
            break
    return returns
