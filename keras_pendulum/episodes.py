"""The loop: the agent lives through episodes and learns after each; one record an episode."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any, NamedTuple

import gymnasium

from keras_pendulum.agent import Agent
from keras_pendulum.exploration import EpsilonDecay
from keras_pendulum.presets import Config
from keras_pendulum.randomness import RandomSource
from keras_pendulum.replay import ReplayBuffer
from keras_pendulum.torque import TorqueGrid


class EpisodeRecord(NamedTuple):
    """What is known of an episode once it is over; the columns of history.csv."""

    episode: int  # from 0
    average_reward: float  # a step
    episode_return: float  # undiscounted sum; "return" in history.csv
    epsilon: float
    loss: float  # mean over the updates after the episode; NaN when there were none
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
    torques: TorqueGrid,
    agent: Agent,
    replay: ReplayBuffer,
    random: RandomSource,
    config: Config,
    last: EpisodeRecord | None = None,
) -> Iterator[EpisodeRecord]:
    """Yields the record of each episode, from the one after `last` to the last of the run.

    The environment is seeded before episode 0 only, as in the recorded run; afterwards its own
    generator goes on.
    """
    schedule = EpsilonDecay(config.epsilon_start, config.epsilon_decay, config.epsilon_min)
    first = 0 if last is None else last.episode + 1
    updates = 0 if last is None else last.updates
    for episode in range(first, config.episodes):
        started = time.perf_counter()
        epsilon = schedule(episode)
        before = replay.added
        seed = random.seed if episode == 0 else None
        total = _run_episode(env, torques, agent, replay, epsilon, config.reward_scale, seed)
        loss = float("nan")
        if episode > config.learning_starts:
            positions = [
                random.batch_positions(len(replay), config.batch_size)
                for _ in range(config.updates_per_episode)
            ]  # [K, B]
            loss = float(agent.update(replay.at(positions)).mean())
            updates += config.updates_per_episode
        yield EpisodeRecord(
            episode=episode,
            average_reward=total / (replay.added - before),
            episode_return=total,
            epsilon=epsilon,
            loss=loss,
            environment_steps=replay.added,
            updates=updates,
            seconds=time.perf_counter() - started,
        )


def _run_episode(
    env: gymnasium.Env[Any, Any],
    torques: TorqueGrid,
    agent: Agent,
    replay: ReplayBuffer,
    epsilon: float,
    reward_scale: float,
    seed: int | None,
) -> float:
    """Acts and remembers until the episode ends; returns the episode return."""
    observation, _ = env.reset(seed=seed)
    total = 0.0
    over = False
    while not over:
        action = agent.select_action(observation, epsilon)
        following, reward, terminated, truncated, _ = env.step(torques.torque(action))
        remembered = torques.remembered_index(action)
        total += float(reward)
        replay.add(observation, remembered, reward_scale * float(reward), following, terminated)
        observation = following
        over = terminated or truncated
    return total
