"""Evaluation: greedy returns from fixed starts, compared with the optimum of each start."""

from __future__ import annotations

import contextlib
import itertools
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import ArrayLike, NDArray

from keras_pendulum.config.fields import Integer, Number
from keras_pendulum.environments.pendulum import Pendulum
from keras_pendulum.environments.task import Task
from keras_pendulum.errors import UserError
from keras_pendulum.evaluate.answers import ActionError
from keras_pendulum.evaluate.policy import Policy
from keras_pendulum.evaluate.score import Score
from keras_pendulum.evaluate.sources import as_policy
from keras_pendulum.optimum.solutions import solution
from keras_pendulum.status import Report

Env = gymnasium.Env[Any, Any]
OnStep = Callable[[Env], None]
Path = NDArray[np.float32]  # [T, D]
USUAL_GRAVITIES = (10.0, 1.0)  # m/s², Gymnasium's default and that of the presets
_SIDE_BY_SIDE = 100  # episodes
_PATHS, _PATH_STEPS = 1000, 100  # that are kept: of the first episodes, their last steps
_STARTS_OF_A_TRIAL = 5


def evaluate_policy(
    agent: Any,
    episodes: int = 100,
    seed: int = 0,
    *,
    environment: str | None = None,
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
            model, a function from an observation to a torque in N·m or to an index, a `q_function`,
            or an object with `predict`.
        episodes: number of episodes.
        seed: seed of the first start.
        environment: `Pendulum-v1` or `CartPole-v1`; None takes the recorded one, else CartPole-v1
            for an agent that takes four numbers, else Pendulum-v1.
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
    policy = as_policy(agent, torques, environment=environment)
    episodes = Integer(1, 1_000_000).validate("episodes", episodes)
    seed = Integer(0, 2**32 - episodes).validate("seed", seed)
    task, assumption = find_task(policy, gravity)
    if discount is None:
        discount = policy.info.discount
    else:
        discount = Number(0, 1).validate("discount", discount)
    seeds = range(seed, seed + episodes)
    returns, ends = _play(policy, task, seeds, render_mode, on_step, on_progress)
    best = solution(task).best_returns(seeds)
    return Score(task, returns, best, discount, seeds, assumption, ends)


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
        returns, _ = _play(policy, task, seeds)
        gained[task] = (float(returns.mean()) - random) / (best - random)
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
) -> tuple[NDArray[np.float64], list[Path]]:
    """Returns the undiscounted returns of the episodes from these seeds, and their paths.

    A path has the last observations [T, D] of an episode that terminated, and none of another.
    """
    # One episode after the other where it is watched, or the policy needs it. Otherwise the policy
    # gets the observations of many episodes in one call.
    episodes = len(seeds)
    alone = policy.one_by_one or render_mode is not None or on_step is not None
    count = 1 if alone else min(_SIDE_BY_SIDE, episodes)
    returns, paths = [], []
    with contextlib.ExitStack() as stack:
        envs = [
            stack.enter_context(contextlib.closing(task.make_env(render_mode)))
            for _ in range(count)
        ]
        for first in range(0, episodes, count):
            numbers = range(first, min(first + count, episodes))
            played = [
                _Episode(env, seeds[number], number)
                for env, number in zip(envs, numbers, strict=False)
            ]
            for step in _play_together(policy, played, on_step):
                on_progress((first + count * step / task.steps_per_episode) / episodes)
            returns += [episode.total for episode in played]
            paths += [episode.path for episode in played]
    return np.array(returns), paths


class _Episode:
    """An episode that is played.

    Args:
        env: its environment.
        seed: of its reset.
        number: of the episode, from 0.
    """

    def __init__(self, env: Env, seed: int, number: int) -> None:
        self.env = env
        self.number = number
        self.observation, _ = env.reset(seed=seed)
        self.total = 0.0
        self.is_over = False
        self._terminated = False
        self._last: deque[NDArray[np.float32]] = deque(maxlen=_PATH_STEPS)

    def step(self, action: Any) -> None:
        """Takes a step."""
        self._last.append(self.observation)
        self.observation, reward, self._terminated, truncated, _ = self.env.step(action)
        self.total += float(reward)
        self.is_over = self._terminated or truncated

    @property
    def path(self) -> Path:
        """The last observations [T, D] before it terminated; [0, D] where it did not."""
        kept = self._terminated and self.number < _PATHS
        return np.array(self._last if kept else [], np.float32).reshape(-1, len(self.observation))


def _play_together(
    policy: Policy, episodes: Sequence[_Episode], on_step: OnStep | None
) -> Iterator[int]:
    """Plays episodes to their ends, in environments of their own; yields the number of each step.

    Raises UserError for an answer that is not an action, with its episode and step.
    """
    policy.reset()
    if on_step:
        on_step(episodes[0].env)
    playing = list(episodes)
    for step in itertools.count():
        try:
            if len(episodes) == 1:
                actions: Any = [policy.action(playing[0].observation)]
            else:
                actions = policy.act(np.stack([each.observation for each in playing]))  # [B, ...]
        except ActionError as error:
            number = playing[error.row].number
            raise UserError(f"episode {number}, step {step}: {error}") from error
        for episode, action in zip(playing, actions, strict=True):
            episode.step(action)
            if on_step:
                on_step(episode.env)
        yield step
        playing = [episode for episode in playing if not episode.is_over]
        if not playing:
            return
