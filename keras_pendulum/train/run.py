"""The factory of a run: it makes the parts, and alone chooses the variants of its Config."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import gymnasium
import keras

from keras_pendulum.config.config import Config
from keras_pendulum.dqn import exploration, losses, target_network
from keras_pendulum.dqn.agent import Agent
from keras_pendulum.dqn.network import DQN
from keras_pendulum.dqn.random_streams import RandomStreams
from keras_pendulum.dqn.replay_buffer import ReplayBuffer
from keras_pendulum.environments.actions import Actions, TruncatingTorqueGrid
from keras_pendulum.errors import ConfigError
from keras_pendulum.history import EpisodeRecord
from keras_pendulum.storage.run_info import RunInfo
from keras_pendulum.train.listeners import Phase


@dataclass
class Run:
    """A run between two of its episodes."""

    config: Config
    env: gymnasium.Env[Any, Any]
    actions: Actions
    agent: Agent
    replay: ReplayBuffer
    epsilon: exploration.Schedule
    streams: RandomStreams
    history: list[EpisodeRecord] = field(default_factory=list)
    # Called when another phase than the training starts, see `train_dqn`.
    announce: Callable[[Phase], None] = lambda phase: None


def make_run(config: Config, initial: DQN | None = None, render: bool = False) -> Run:
    """Returns a new run; with `render`, its environment has a window.

    The weights of `initial` replace the seeded initial weights. Raises ConfigError when `initial`
    has other layers than `config`.
    """
    task = config.task
    streams = RandomStreams(config.seed)
    actions = {
        "exact": task.actions(config.torque_count),
        "truncated": TruncatingTorqueGrid(),
    }[config.stored_index]
    online = DQN(
        config.hidden_units,
        actions.count,
        observation_size=task.observation_size,
        activation=config.activation,
        initial_weights=config.initial_weights,
        seed=config.seed,
        metadata=RunInfo(task, config.preset, config.seed, vars(config)).as_record(),
    )
    if initial is not None:
        _copy_weights(initial, online)
    target_updates: dict[str, target_network.TargetUpdate] = {
        "none": target_network.no_update,
        "hard": partial(target_network.hard_update, config.target_period),
        "soft": partial(target_network.soft_update, config.tau),
    }
    agent = Agent(
        online,
        online if config.target_update == "none" else online.clone(),
        target_network.double_q_learning if config.double_q else target_network.q_learning,
        target_updates[config.target_update],
        make_optimizer(config),
        {"squared": losses.mean_squared_error, "huber": losses.huber}[config.loss],
        config.discount,
        streams.exploration,
    )
    start, lowest = config.epsilon_start, config.epsilon_min
    epsilon = {
        "episodes": partial(exploration.epsilon_by_episodes, start, config.epsilon_decay, lowest),
        "steps": partial(exploration.epsilon_by_steps, start, config.epsilon_decay_steps, lowest),
    }[config.epsilon_schedule]
    mode = "human" if render else None
    env = task.make_env(mode, config.max_episode_steps)
    replay = ReplayBuffer(config.replay_capacity, task.observation_size)
    return Run(config, env, actions, agent, replay, epsilon, streams)


def make_optimizer(config: Config) -> keras.optimizers.Optimizer:
    """Returns Adam (Kingma & Ba 2015), or AdamW with AMSGrad."""
    rate, steps = config.learning_rate, max(1, config.total_updates)
    schedule = {
        "constant": rate,
        "cosine": keras.optimizers.schedules.CosineDecay(
            rate, steps, alpha=config.learning_rate_min / rate
        ),
    }[config.learning_rate_schedule]
    optimizer = {
        "adam": keras.optimizers.Adam,
        "adamw": partial(keras.optimizers.AdamW, weight_decay=config.weight_decay, amsgrad=True),
    }[config.optimizer]
    return optimizer(
        schedule,
        epsilon=config.optimizer_epsilon,
        clipvalue=config.gradient_clip,
        use_ema=config.average_updates > 1,
        ema_momentum=1 - 1 / config.averaged_updates,
        name=config.optimizer,  # the variables have the same paths in every process
    )


def _copy_weights(source: DQN, destination: DQN) -> None:
    names = ("environment", "observation_size", "hidden_units", "action_count", "activation")
    for name in names:
        found, expected = (getattr(n, name, n.metadata.get(name)) for n in (source, destination))
        if found not in (expected, None):
            raise ConfigError(
                f"the initial network has {name} {found}, the settings say {expected}"
            )
    destination.set_weights(source.get_weights())
