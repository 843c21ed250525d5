"""The parts of a run, made from its Config."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from typing import Any

import gymnasium
import keras

from keras_pendulum.config.config import Config
from keras_pendulum.dqn.agent import Agent
from keras_pendulum.dqn.exploration import Schedule, make_schedule
from keras_pendulum.dqn.losses import huber, mean_squared_error
from keras_pendulum.dqn.network import DQN, Provenance
from keras_pendulum.dqn.random_streams import RandomStreams
from keras_pendulum.dqn.replay_buffer import ReplayBuffer
from keras_pendulum.dqn.target_network import make_target
from keras_pendulum.environments.actions import Actions, make_actions
from keras_pendulum.environments.tasks import TASKS, make_environment
from keras_pendulum.errors import ConfigError
from keras_pendulum.history import EpisodeRecord


@dataclass
class Run:
    """A run between two of its episodes."""

    config: Config
    env: gymnasium.Env[Any, Any]
    actions: Actions
    agent: Agent
    replay: ReplayBuffer
    epsilon: Schedule
    streams: RandomStreams
    history: list[EpisodeRecord] = field(default_factory=list)


def make_run(config: Config, initial: DQN | None = None, render: bool = False) -> Run:
    """Returns a new run.

    Args:
        config: the settings.
        initial: a network whose weights replace the seeded initial weights.
        render: whether to show the environment in a window.

    Raises ConfigError when `initial` has other layers than `config`.
    """
    task = TASKS[config.environment]
    streams = RandomStreams(config.seed)
    actions = make_actions(config.environment, config.torque_count, config.stored_index)
    settings = json.dumps(asdict(config))
    online = DQN(
        config.hidden_units,
        actions.count,
        observation_size=task.observation_size,
        activation=config.activation,
        initial_weights=config.initial_weights,
        seed=config.seed,
        provenance=Provenance(
            config.environment, config.gravity, config.preset, config.seed, settings
        ),
    )
    if initial is not None:
        _copy_weights(initial, online)
    target, update_target = make_target(online, config)
    mode = "human" if render else None
    env = make_environment(config.environment, config.gravity, mode, config.max_episode_steps)
    agent = Agent(
        online,
        target,
        update_target,
        make_optimizer(config),
        {"squared": mean_squared_error, "huber": huber}[config.loss],
        config.discount,
        config.double_q,
        streams.exploration,
    )
    replay = ReplayBuffer(config.replay_capacity, task.observation_size)
    return Run(config, env, actions, agent, replay, make_schedule(config), streams)


def make_optimizer(config: Config) -> keras.optimizers.Optimizer:
    """Returns Adam (Kingma & Ba 2015), or AdamW with AMSGrad."""
    learning_rate: Any = config.learning_rate
    if config.learning_rate_schedule == "cosine":
        lowest = config.learning_rate_min / config.learning_rate
        learning_rate = keras.optimizers.schedules.CosineDecay(
            config.learning_rate, max(1, config.total_updates), alpha=lowest
        )
    # With a fixed name, the variables have the same paths in every process.
    settings: dict[str, Any] = {
        "epsilon": config.optimizer_epsilon,
        "clipvalue": config.gradient_clip,
        "use_ema": config.average_updates > 1,
        "ema_momentum": 1 - 1 / config.average_updates,
        "name": config.optimizer,
    }
    if config.optimizer == "adam":
        return keras.optimizers.Adam(learning_rate, **settings)
    return keras.optimizers.AdamW(
        learning_rate, weight_decay=config.weight_decay, amsgrad=True, **settings
    )


def _copy_weights(source: DQN, destination: DQN) -> None:
    found, expected = source.get_config(), destination.get_config()
    for name in ("environment", "observation_size", "hidden_units", "action_count", "activation"):
        if found[name] != expected[name]:
            raise ConfigError(
                f"the initial network has {name} {found[name]}, the settings say {expected[name]}"
            )
    destination.set_weights(source.get_weights())
