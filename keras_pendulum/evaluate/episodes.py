"""The episodes of an evaluation: one after the other, or 100 at a time."""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from keras_pendulum.errors import UserError
from keras_pendulum.evaluate.agents import Agent
from keras_pendulum.evaluate.answers import ActionError

OnStep = Callable[[gymnasium.Env[Any, Any]], None]
_SIDE_BY_SIDE = 100  # episodes


def episode_returns(
    agent: Agent,
    make: Callable[[], gymnasium.Env[Any, Any]],
    seeds: range,
    on_step: OnStep | None = None,
    *,
    one_by_one: bool = False,
) -> NDArray[np.float64]:
    """Returns the undiscounted returns [episodes].

    A network of this package acts in one episode after the other, which is fast without a call into
    TensorFlow. So does a function of one observation, which may have a state. Other agents get the
    observations of many episodes in one call.

    Args:
        agent: the agent.
        make: returns a new environment.
        seeds: `reset(seed=...)` of each episode.
        on_step: called with the environment after each reset and each step.
        one_by_one: makes one episode after the other with every agent.

    Raises UserError, with the episode and the step, for an answer that is no torque.
    """
    if agent.env_action is None and agent.batched and not one_by_one:
        starts = range(0, len(seeds), _SIDE_BY_SIDE)
        blocks = [seeds[start : start + _SIDE_BY_SIDE] for start in starts]
        returns = [
            _returns_side_by_side(agent, make, block, start)
            for start, block in zip(starts, blocks, strict=True)
        ]
        return np.concatenate(returns)

    with contextlib.closing(make()) as env:
        return np.array(
            [
                episode_return(env, seed, agent.action, on_step, episode)
                for episode, seed in enumerate(seeds)
            ]
        )


def episode_return(
    env: gymnasium.Env[Any, Any],
    seed: int,
    act: Callable[[NDArray[np.float32]], Any],
    on_step: OnStep | None = None,
    episode: int = 0,
) -> float:
    """Returns the return of one episode; `act` returns the action as the environment takes it."""
    on_step = on_step or (lambda env: None)
    observation, _ = env.reset(seed=seed)
    on_step(env)
    total = 0.0
    for step in itertools.count():
        try:
            action = act(observation)
        except ActionError as error:
            raise _located(error, episode, step) from error
        observation, reward, terminated, truncated, _ = env.step(action)
        on_step(env)
        total += float(reward)
        if terminated or truncated:
            return total
    raise AssertionError  # an episode ends


def _returns_side_by_side(
    agent: Agent, make: Callable[[], gymnasium.Env[Any, Any]], seeds: range, first: int
) -> NDArray[np.float64]:
    """Returns the returns of episodes of the pendulum, which all have the same length.

    `first` is the number of the first episode, for messages.
    """
    with contextlib.ExitStack() as stack:
        envs = [stack.enter_context(contextlib.closing(make())) for _ in seeds]
        observations = [env.reset(seed=seed)[0] for env, seed in zip(envs, seeds, strict=True)]
        returns, truncated = np.zeros(len(envs)), False
        for step in itertools.count():
            try:
                torques = agent.act(np.stack(observations))  # [B]
            except ActionError as error:
                raise _located(error, first + error.row, step) from error
            for row, env in enumerate(envs):
                observations[row], reward, _, truncated, _ = env.step(torques[row : row + 1])
                returns[row] += float(reward)
            if truncated:
                break
    return returns


def _located(error: ActionError, episode: int, step: int) -> UserError:
    return UserError(f"episode {episode}, step {step}: {error}")
