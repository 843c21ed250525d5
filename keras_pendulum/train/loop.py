"""The training loop: episodes, their transitions, and the updates between them."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator

import numpy as np

from keras_pendulum.errors import UserError
from keras_pendulum.history import EpisodeRecord
from keras_pendulum.train.run import Run


def train_episodes(
    run: Run, evaluate: Callable[[Run, int], float] = lambda run, episode: math.nan
) -> Iterator[EpisodeRecord]:
    """Trains from the next episode of the run to its last, and yields each episode's record.

    After the last episode, the moving average replaces the online weights. `evaluate` returns the
    greedy regret after an episode, NaN where it is not evaluated.

    Raises UserError, with episode and step, when an observation, a reward or a loss is not finite.
    """
    for episode in range(len(run.history), run.config.episodes):
        record = _train_episode(run, episode, evaluate)
        run.history.append(record)
        yield record


def _train_episode(run: Run, episode: int, evaluate: Callable[[Run, int], float]) -> EpisodeRecord:
    """Plays one episode, makes its updates, and evaluates."""
    config, env, actions, agent, replay = run.config, run.env, run.actions, run.agent, run.replay
    started = time.perf_counter()
    # Only episode 0 seeds the environment, as in the recorded run.
    observation, _ = env.reset(seed=config.seed if episode == 0 else None)
    episode_return = 0.0
    step = 0
    losses: list[float] = []
    done = False
    while not done:
        step += 1
        epsilon = run.epsilon(episode, replay.added)
        action = agent.select_action(observation, epsilon)
        next_observation, reward, terminated, truncated, _ = env.step(actions.to_env_action(action))
        reward = float(reward)
        if not math.isfinite(sum(next_observation.tolist(), reward)):
            raise UserError(
                f"episode {episode}, step {step}: the environment returned the reward {reward} and "
                f"the observation {next_observation}; expected finite numbers"
            )
        replay.add(
            observation,
            actions.stored_index(action),
            config.reward_scale * reward,
            next_observation,
            terminated,
        )
        episode_return += reward
        observation = next_observation
        done = terminated or truncated
        if config.train_frequency == "step":
            losses += _update(run, 1, episode, step)
    if config.train_frequency == "episode" and episode >= config.warmup_episodes:
        losses += _update(run, config.updates_per_episode, episode, step)
    seconds = time.perf_counter() - started
    if episode + 1 == config.episodes:
        agent.average_weights()
    return EpisodeRecord(
        episode=episode,
        average_reward=episode_return / step,
        episode_return=episode_return,
        epsilon=epsilon,
        loss=float(np.mean(losses)) if losses else math.nan,
        environment_steps=replay.added,
        updates=(run.history[-1].updates if run.history else 0) + len(losses),
        seconds=seconds,
        greedy_regret=evaluate(run, episode),
    )


def _update(run: Run, updates: int, episode: int, step: int) -> list[float]:
    """Makes `updates` updates and returns their losses; none before the first full batch.

    Raises UserError when a loss is not finite.
    """
    config, replay = run.config, run.replay
    if len(replay) < config.batch_size:
        return []
    batches = replay.sample(config.batch_size, run.streams.replay, updates)  # [K, B, ...]
    if not run.agent.is_compiled(batches):
        run.announce("compiling")
    losses: list[float] = run.agent.update(batches).tolist()
    for loss in losses:
        if not math.isfinite(loss):
            raise UserError(
                f"episode {episode}, step {step}: the loss is {loss}, learning has diverged; try a "
                "smaller learning_rate"
            )
    return losses
