"""The target network, and the rules that update it."""

from __future__ import annotations

from collections.abc import Callable

import tensorflow as tf

from keras_pendulum.config.config import Config
from keras_pendulum.dqn.network import DQN

# Called after each gradient step, inside the compiled loop, with the online network, the target
# network and the number of gradient steps so far (a scalar integer tensor).
TargetUpdate = Callable[[DQN, DQN, tf.Tensor], None]


def make_target(online: DQN, config: Config) -> tuple[DQN, TargetUpdate]:
    """Returns the target network and its update rule.

    `target_update="none"` is the original's defect `no-target-network`: the online network is its
    own target.
    """
    if config.target_update == "none":
        return online, _no_update
    if config.target_update == "hard":
        return online.clone(), hard_update(config.target_period)
    return online.clone(), soft_update(config.tau)


def soft_update(tau: float) -> TargetUpdate:
    """Returns the rule target ← tau·online + (1 - tau)·target (Lillicrap et al. 2016, alg. 1)."""

    def update(online: DQN, target: DQN, steps: tf.Tensor) -> None:
        for source, destination in zip(online.weights, target.weights, strict=True):
            destination.assign(tau * source + (1.0 - tau) * destination)

    return update


def hard_update(period: int) -> TargetUpdate:
    """Returns the rule target ← online at every `period`-th gradient step (Mnih et al. 2015)."""

    def update(online: DQN, target: DQN, steps: tf.Tensor) -> None:
        due = tf.equal(steps % period, 0)
        for source, destination in zip(online.weights, target.weights, strict=True):
            destination.assign(tf.where(due, source, destination))

    return update


def _no_update(online: DQN, target: DQN, steps: tf.Tensor) -> None:
    """Does nothing: the target network is the online network."""
