"""One run put together: the parts that its Config names, and its history so far."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict

import keras

from keras_pendulum.actions import Actions, make_actions
from keras_pendulum.agent import Agent
from keras_pendulum.config import Config
from keras_pendulum.defects import TruncatingTorqueGrid
from keras_pendulum.environment import TASKS, make_environment
from keras_pendulum.episodes import EpisodeRecord, learn_episodes
from keras_pendulum.errors import ConfigError
from keras_pendulum.network import DQN, Origin
from keras_pendulum.q_learning import huber, mean_squared_error
from keras_pendulum.randomness import RandomSource
from keras_pendulum.rehearsal import AHEAD
from keras_pendulum.replay import ReplayBuffer
from keras_pendulum.rollout import Parts
from keras_pendulum.target_network import make_target


class Run:
    """A run between two of its episodes; `checkpoint` saves it and brings it back.

    Args:
        config: the settings.
        initial: a network whose weights to start from, in place of fresh ones.
        render: show the environment in a window.

    Raises ConfigError when `initial` has other layer sizes than `config`.
    """

    def __init__(self, config: Config, initial: DQN | None = None, render: bool = False) -> None:
        self.config = config
        self.random = RandomSource(config.seed)
        self.env = make_environment(
            config.environment,
            config.gravity,
            "human" if render else None,
            config.episode_steps,
        )
        self.actions = actions_of(config)
        self.replay = ReplayBuffer(
            config.replay_capacity,
            TASKS[config.environment].observation_size,
            spare=AHEAD if config.update_after == "step" else 0,
        )
        self.agent = make_agent(config, self.random, initial)
        self.history: list[EpisodeRecord] = []

    def close(self) -> None:
        """Ends what goes on beside the run: a window, and the thread that learns."""
        self.env.close()
        self.agent.close()

    def episodes(self) -> Iterator[EpisodeRecord]:
        """Goes on to the end of the run, yielding each episode's record."""
        last = self.history[-1] if self.history else None
        parts = Parts(self.env, self.actions, self.agent, self.replay, self.random, self.config)
        for record in learn_episodes(parts, last):
            self.history.append(record)
            yield record


def actions_of(config: Config) -> Actions:
    """What the indices stand for, and what the memory keeps of them."""
    if config.remembered_action == "truncated":
        return TruncatingTorqueGrid()
    return make_actions(config.environment, config.torque_count)


def make_agent(config: Config, random: RandomSource, initial: DQN | None = None) -> Agent:
    """A fresh agent; see Run for the arguments."""
    online = DQN(
        config.hidden_units,
        actions_of(config).count,
        observation_size=TASKS[config.environment].observation_size,
        activation=config.activation,
        initial_weights=config.initial_weights,
        seed=config.seed,
        origin=Origin(
            config.environment,
            config.gravity,
            config.preset,
            config.seed,
            json.dumps(asdict(config)),
        ),
    )
    if initial is not None:
        _copy_weights(initial, online)
    target, update_target = make_target(online, config)
    return Agent(
        online,
        target,
        update_target,
        make_optimizer(config),
        {"squared": mean_squared_error, "huber": huber}[config.loss],
        config.discount,
        config.bootstrap == "double",
        random,
    )


def make_optimizer(config: Config) -> keras.optimizers.Optimizer:
    """Adam (Kingma & Ba 2015), or AdamW with AMSGrad."""
    learning_rate: float | keras.optimizers.schedules.LearningRateSchedule = config.learning_rate
    if config.learning_rate_schedule == "cosine":
        learning_rate = keras.optimizers.schedules.CosineDecay(
            config.learning_rate, max(1, config.total_updates)
        )
    numbers = {"epsilon": config.optimizer_epsilon, "clipvalue": config.gradient_clip}
    if config.optimizer == "adam":
        return keras.optimizers.Adam(learning_rate, **numbers)
    return keras.optimizers.AdamW(
        learning_rate, weight_decay=config.weight_decay, amsgrad=True, **numbers
    )


def _copy_weights(source: DQN, destination: DQN) -> None:
    if source.origin.environment != destination.origin.environment:
        raise ConfigError(
            f"the initial network belongs to {source.origin.environment}, the settings to "
            f"{destination.origin.environment}: take a network of the same environment"
        )
    found = (*source.hidden_units, source.action_count)
    expected = (*destination.hidden_units, destination.action_count)
    if found != expected:
        raise ConfigError(
            f"the initial network has layers {'-'.join(map(str, found))}, the settings say "
            f"{'-'.join(map(str, expected))}: set hidden_units and torque_count to match"
        )
    if source.activation != destination.activation:
        raise ConfigError(
            f"the initial network's activation is {source.activation}, the settings say "
            f"{destination.activation}: set activation to match"
        )
    destination.set_weights(source.get_weights())
