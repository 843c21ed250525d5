"""The target network, and how it follows the online network."""

from __future__ import annotations

from collections.abc import Callable

import tensorflow as tf

from keras_pendulum.config import Config
from keras_pendulum.network import DQN

# Called after every update, inside the compiled loop, with the online network, the target
# network, and the number of updates made so far (a scalar integer tensor).
TargetUpdate = Callable[[DQN, DQN, tf.Tensor], None]


def make_target(online: DQN, config: Config) -> tuple[DQN, TargetUpdate]:
    """The target network and its update rule.

    `target_update="none"` is the original's defect `no-target-network`: the online network
    itself, which chases its own values.
    """
    if config.target_update == "none":
        return online, _no_update
    if config.target_update == "hard":
        return online.twin(), hard_update(config.target_period)
    return online.twin(), soft_update(config.target_blend)


def soft_update(blend: float) -> TargetUpdate:
    """target ← blend·online + (1 - blend)·target (Lillicrap et al. 2016, algorithm 1)."""

    def update(online: DQN, target: DQN, updates: tf.Tensor) -> None:
        for ours, theirs in zip(online.weights, target.weights, strict=True):
            theirs.assign(blend * ours + (1.0 - blend) * theirs)

    return update


def hard_update(period: int) -> TargetUpdate:
    """target ← online at every `period`-th update, nothing in between (Mnih et al. 2015)."""

    def update(online: DQN, target: DQN, updates: tf.Tensor) -> None:
        due = tf.equal(updates % period, 0)
        for ours, theirs in zip(online.weights, target.weights, strict=True):
            theirs.assign(tf.where(due, ours, theirs))

    return update


def _no_update(online: DQN, target: DQN, updates: tf.Tensor) -> None:
    """Right where the target network *is* the online network."""
