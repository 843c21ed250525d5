"""An episode as it goes on: the agent acts, and the memory keeps what comes of it."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import gymnasium
import numpy as np
from numpy.typing import NDArray

from keras_pendulum.actions import Actions
from keras_pendulum.agent import Agent
from keras_pendulum.config import Config
from keras_pendulum.environment import snapshot
from keras_pendulum.errors import UserError
from keras_pendulum.exploration import Schedule
from keras_pendulum.randomness import RandomSource
from keras_pendulum.replay import ReplayBuffer


class Step(NamedTuple):
    """One step of an episode."""

    action: int
    explored: bool  # whether the action was drawn at random
    following: NDArray[np.float32]  # [D], the observation after it


class Parts(NamedTuple):
    """What plays together in a run."""

    env: gymnasium.Env[Any, Any]
    actions: Actions
    agent: Agent
    replay: ReplayBuffer
    random: RandomSource
    config: Config


class Rollout:
    """One episode, from its reset on.

    Args:
        parts: of the run.
        schedule: gives ε.
        episode: its number; the environment is seeded before episode 0 only, as in the recorded
            run, and its own generator goes on afterwards.
    """

    def __init__(self, parts: Parts, schedule: Schedule, episode: int) -> None:
        self._parts = parts
        self._schedule = schedule
        self._before = parts.replay.added
        self.episode = episode
        self.observation, _ = parts.env.reset(seed=parts.random.seed if episode == 0 else None)
        self.total = 0.0  # of the rewards
        self.epsilon = math.nan  # of the last step
        self.over = False

    @property
    def steps(self) -> int:
        """Steps made."""
        return self._parts.replay.added - self._before

    def step(self, known: int | None = None) -> Step:
        """Makes one step and remembers it; `known` is the greedy action, where it is known.

        Raises UserError, with episode and step, when the reward or the observation is not finite:
        nothing that follows could be trusted.
        """
        env, actions, agent, replay, _, config = self._parts
        self.epsilon = self._schedule(self.episode, replay.added)
        observation = self.observation
        action, explored = agent.select_action(observation, self.epsilon, known)
        following, reward, terminated, truncated, _ = env.step(actions.control(action))
        reward = float(reward)
        if not math.isfinite(sum(following.tolist(), reward)):
            raise UserError(
                f"episode {self.episode}, step {self.steps + 1}: the environment gave "
                f"the reward {reward} and the observation {following}"
            )
        replay.add(
            observation,
            actions.remembered_index(action),
            config.reward_scale * reward,
            following,
            terminated,
        )
        self.total += reward
        self.observation = following
        self.over = terminated or truncated
        return Step(action, explored, following)

    def finish(self) -> None:
        """Makes the steps that are left."""
        while not self.over:
            self.step()

    def snapshot(self) -> Callable[[], None]:
        """What, called later, takes back the steps made since."""
        env, _, _, replay, random, _ = self._parts
        restore_environment, restore_exploration = snapshot(env), random.exploration_snapshot()
        observation, total, steps = self.observation, self.total, self.steps

        def go_back() -> None:
            restore_environment()
            restore_exploration()
            replay.take_back(self.steps - steps)
            self.observation, self.total, self.over = observation, total, False

        return go_back
