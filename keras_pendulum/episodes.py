"""The loop: the agent lives through episodes and learns on the way; one record an episode."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from keras_pendulum.config import Config
from keras_pendulum.errors import UserError
from keras_pendulum.exploration import make_schedule
from keras_pendulum.rehearsal import AHEAD, learn_each_step
from keras_pendulum.replay import Transitions
from keras_pendulum.rollout import Parts, Rollout


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


def learn_episodes(parts: Parts, last: EpisodeRecord | None = None) -> Iterator[EpisodeRecord]:
    """Yields the record of each episode, from the one after `last` to the last of the run.

    Raises UserError, with episode and step, when a reward, an observation or a loss is not finite:
    nothing that follows could be trusted.
    """
    config, replay = parts.config, parts.replay
    schedule = make_schedule(config)
    first = 0 if last is None else last.episode + 1
    updates = 0 if last is None else last.updates
    # What is shown cannot be taken back.
    ahead = AHEAD if parts.env.render_mode is None else 1

    for episode in range(first, config.episodes):
        started = time.perf_counter()
        rollout = Rollout(parts, schedule, episode)
        if config.update_after == "step":
            losses = learn_each_step(rollout, parts, ahead)
        elif config.update_after == "reset":
            losses = _learn_meanwhile(rollout, parts)
        else:
            rollout.finish()
            losses = _learn(rollout, parts)
        _check_losses(losses, rollout, config)
        updates += len(losses)
        yield EpisodeRecord(
            episode=episode,
            average_reward=rollout.total / rollout.steps,
            episode_return=rollout.total,
            epsilon=rollout.epsilon,
            loss=float(np.mean(losses)) if losses else float("nan"),
            environment_steps=replay.added,
            updates=updates,
            seconds=time.perf_counter() - started,
        )


def _learn(rollout: Rollout, parts: Parts) -> list[float]:
    """The updates after an episode; returns their losses."""
    batches = _batches(rollout, parts)
    return [] if batches is None else parts.agent.update(batches).tolist()


def _learn_meanwhile(rollout: Rollout, parts: Parts) -> list[float]:
    """Plays an episode to its end while the updates go on; returns their losses.

    They learn from the episodes before, and act from the next one on: so acting and learning have a
    processor core each, and what comes of it does not depend on which is the faster.
    """
    batches = _batches(rollout, parts)
    if batches is None:
        rollout.finish()
        return []
    finish_update = parts.agent.begin_update(batches)
    rollout.finish()
    return finish_update().tolist()


def _batches(rollout: Rollout, parts: Parts) -> Transitions | None:
    """The batches [K, B, ...] of the updates that belong to an episode; None without updates."""
    _, _, _, replay, random, config = parts
    if rollout.episode <= config.learning_starts or len(replay) < config.batch_size:
        return None
    return replay.at(
        [
            random.batch_positions(len(replay), config.batch_size)
            for _ in range(config.updates_per_episode)
        ]
    )


def _check_losses(losses: list[float], rollout: Rollout, config: Config) -> None:
    for i, loss in enumerate(losses):
        if not math.isfinite(loss):
            later = len(losses) - 1 - i if config.update_after == "step" else 0
            raise UserError(
                f"episode {rollout.episode}, step {rollout.steps - later}: the loss is {loss}, "
                "learning has diverged; try a smaller learning_rate"
            )
