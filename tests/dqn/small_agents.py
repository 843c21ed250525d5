"""Small agents, and batches for their updates."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import keras
import numpy as np
import tensorflow as tf
from numpy.typing import NDArray

from keras_pendulum.dqn.agent import Agent
from keras_pendulum.dqn.losses import mean_squared_error
from keras_pendulum.dqn.network import DQN
from keras_pendulum.dqn.replay_buffer import Transitions
from keras_pendulum.dqn.target_network import (
    TargetRule,
    TargetUpdate,
    no_update,
    q_learning,
    soft_update,
)

OBSERVATION = np.array([1, 0, 0], np.float32)  # [D]
SOFT: TargetUpdate = partial(soft_update, 0.25)
Weights = list[NDArray[np.float32]]


def make_agent(
    online: DQN | None = None,
    *,
    optimizer: keras.optimizers.Optimizer | None = None,
    loss: Callable[..., tf.Tensor] = mean_squared_error,
    discount: float = 0.9,
    target_rule: TargetRule = q_learning,
    update_target: TargetUpdate = SOFT,
    seed: int = 0,
) -> Agent:
    online = online or DQN((8,), seed=seed)
    return Agent(
        online,
        online if update_target is no_update else online.clone(),
        target_rule,
        update_target,
        optimizer or keras.optimizers.Adam(0.01, name="adam"),
        loss,
        discount,
        np.random.RandomState(seed),
    )


def random_batches(batches: int, batch_size: int = 4, seed: int = 0) -> Transitions:
    """Returns transitions [K, B]; about one in three is terminated."""
    random = np.random.RandomState(seed)
    shape = (batches, batch_size)
    return Transitions(
        random.randn(*shape, 3).astype(np.float32),
        random.randint(0, 41, shape).astype(np.int32),
        -random.rand(*shape).astype(np.float32),
        random.randn(*shape, 3).astype(np.float32),
        random.rand(*shape) < 1 / 3,
    )


def assert_weights(ours: Weights, theirs: Weights, rtol: float = 0, atol: float = 0) -> None:
    for mine, yours in zip(ours, theirs, strict=True):
        np.testing.assert_allclose(mine, yours, rtol, atol)


def differ(ours: Weights, theirs: Weights) -> bool:
    return any((mine != yours).any() for mine, yours in zip(ours, theirs, strict=True))
