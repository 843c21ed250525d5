"""One run put together: the parts that its Config names, and its history so far."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict

import keras

from keras_pendulum.agent import Agent
from keras_pendulum.defects import TruncatingTorqueGrid
from keras_pendulum.environment import make_environment
from keras_pendulum.episodes import EpisodeRecord, learn_episodes
from keras_pendulum.errors import ConfigError
from keras_pendulum.network import DQN, Origin
from keras_pendulum.presets import Config
from keras_pendulum.randomness import RandomSource
from keras_pendulum.replay import ReplayBuffer
from keras_pendulum.target_network import make_target
from keras_pendulum.torque import TorqueGrid


class Run:
    """A run between two of its episodes; `checkpoint` saves it and brings it back.

    Args:
        config: the settings.
        initial: a network whose weights to start from, in place of fresh ones.

    Raises ConfigError when `initial` has other layer sizes than `config`.
    """

    def __init__(self, config: Config, initial: DQN | None = None) -> None:
        self.config = config
        self.random = RandomSource(config.seed)
        self.env = make_environment(config.environment, config.gravity, steps=config.episode_steps)
        self.torques = make_torques(config)
        self.replay = ReplayBuffer(config.replay_capacity)
        self.agent = make_agent(config, self.random, initial)
        self.history: list[EpisodeRecord] = []

    def episodes(self) -> Iterator[EpisodeRecord]:
        """Goes on to the end of the run, yielding each episode's record."""
        last = self.history[-1] if self.history else None
        for record in learn_episodes(
            self.env, self.torques, self.agent, self.replay, self.random, self.config, last
        ):
            self.history.append(record)
            yield record


def make_torques(config: Config) -> TorqueGrid:
    """The torques that actions stand for, and what the memory keeps of them."""
    if config.remembered_action == "truncated":
        return TruncatingTorqueGrid()
    return TorqueGrid(config.torque_count)


def make_agent(config: Config, random: RandomSource, initial: DQN | None = None) -> Agent:
    """A fresh agent; see Run for the arguments."""
    online = DQN(
        config.hidden_units,
        config.torque_count,
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
    learning_rate: float | keras.optimizers.schedules.LearningRateSchedule = config.learning_rate
    if config.learning_rate_schedule == "cosine":
        learning_rate = keras.optimizers.schedules.CosineDecay(
            config.learning_rate, max(1, config.total_updates)
        )
    optimizer = keras.optimizers.Adam(learning_rate)  # Kingma & Ba 2015; ε = 1e-7, Keras's own
    double_q = config.bootstrap == "double"
    return Agent(online, target, update_target, optimizer, config.discount, double_q, random)


def _copy_weights(source: DQN, destination: DQN) -> None:
    found = (*source.hidden_units, source.action_count)
    expected = (*destination.hidden_units, destination.action_count)
    if found != expected:
        raise ConfigError(
            f"the initial network has layers {'-'.join(map(str, found))}, the settings say "
            f"{'-'.join(map(str, expected))}: set hidden_units and torque_count to match"
        )
    destination.set_weights(source.get_weights())
