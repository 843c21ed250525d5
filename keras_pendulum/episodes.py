"""The loop: the agent lives through episodes and learns on the way; one record an episode."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from typing import Any, NamedTuple

import gymnasium
import numpy as np
from numpy.typing import NDArray

from keras_pendulum.actions import Actions
from keras_pendulum.agent import Agent
from keras_pendulum.config import Config
from keras_pendulum.errors import UserError
from keras_pendulum.exploration import make_schedule
from keras_pendulum.randomness import RandomSource
from keras_pendulum.replay import ReplayBuffer


class EpisodeRecord(NamedTuple):
    """What is known of an episode once it is over; the columns of history.csv."""

    episode: int  # from 0
    average_reward: float  # a step
    episode_return: float  # undiscounted sum; "return" in history.csv
    epsilon: float  # of its last step
    loss: float  # mean over the updates that came with it; NaN when there were none
    environment_steps: int  # since the start of the run
    updates: int  # since the start of the run
    seconds: float  # wall-clock time of this episode with its updates

    def line(self) -> str:
        """The line that the original prints."""
        return (
            f"Episode: {self.episode}, Average Reward: {self.average_reward:.3f}, "
            f"Epsilon: {self.epsilon:.2f}"
        )


def learn_episodes(
    env: gymnasium.Env[Any, Any],
    actions: Actions,
    agent: Agent,
    replay: ReplayBuffer,
    random: RandomSource,
    config: Config,
    last: EpisodeRecord | None = None,
) -> Iterator[EpisodeRecord]:
    """Yields the record of each episode, from the one after `last` to the last of the run.

    The environment is seeded before episode 0 only, as in the recorded run; afterwards its own
    generator goes on.

    Raises UserError, with episode and step, when a reward, an observation or a loss is not finite:
    nothing that follows could be trusted.
    """
    schedule = make_schedule(config)
    first = 0 if last is None else last.episode + 1
    updates = 0 if last is None else last.updates

    def learn(count: int, following: NDArray[np.float32] | None = None) -> list[float]:
        positions = [
            random.batch_positions(len(replay), config.batch_size) for _ in range(count)
        ]  # [K, B]
        losses: list[float] = agent.update(replay.at(positions), following).tolist()
        wrong = [loss for loss in losses if not math.isfinite(loss)]
        if wrong:
            raise UserError(
                f"episode {episode}, step {replay.added - before}: the loss is {wrong[0]}, "
                "learning has diverged; try a smaller learning_rate"
            )
        return losses

    for episode in range(first, config.episodes):
        started = time.perf_counter()
        before = replay.added
        total = 0.0
        losses: list[float] = []
        observation, _ = env.reset(seed=random.seed if episode == 0 else None)
        over = False
        while not over:
            epsilon = schedule(episode, replay.added)
            action = agent.select_action(observation, epsilon)
            following, reward, terminated, truncated, _ = env.step(actions.control(action))
            reward = float(reward)
            if not math.isfinite(reward + following.dot(following)):
                raise UserError(
                    f"episode {episode}, step {replay.added - before + 1}: the environment gave "
                    f"the reward {reward} and the observation {following}"
                )
            replay.add(
                observation,
                actions.remembered_index(action),
                config.reward_scale * reward,
                following,
                terminated,
            )
            if config.update_after == "step" and len(replay) >= config.batch_size:
                losses += learn(1, following)
            total += reward
            observation = following
            over = terminated or truncated
        due = config.update_after == "episode" and episode > config.learning_starts
        if due and len(replay) >= config.batch_size:
            losses += learn(config.updates_per_episode)
        updates += len(losses)
        yield EpisodeRecord(
            episode=episode,
            average_reward=total / (replay.added - before),
            episode_return=total,
            epsilon=epsilon,
            loss=float(np.mean(losses)) if losses else float("nan"),
            environment_steps=replay.added,
            updates=updates,
            seconds=time.perf_counter() - started,
        )
