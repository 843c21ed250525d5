"""Small programs around a recorder, each with one mistake."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np

import keras_pendulum as kp
from keras_pendulum.optimum.dynamics import TORQUES

Act = Callable[[Any], float]  # from an observation [3] to a torque in N·m


def swing_up(observation: Any) -> float:
    """Returns a torque of 41 that depends on the state."""
    push = np.clip(-10 * observation[1] - 2 * observation[2], -2, 2)
    return float(TORQUES[np.abs(TORQUES - push).argmin()])


def record_run(
    act: Act = swing_up,
    episodes: int = 20,
    steps: int = 100,
    epsilon: Callable[[float], float] = lambda done: max(0.05, 1 - 2 * done),
    wrap: Callable[[Any], Any] = lambda env: env,
    reset: dict[str, float] | None = None,
    gravity: float = 1.0,
) -> kp.Recorder:
    """Returns the recorder of a run; ε depends on the share of the episodes that are done."""
    random = np.random.RandomState(0)
    env = kp.Recorder(wrap(gymnasium.make("Pendulum-v1", g=gravity)))
    for episode in range(episodes):
        observation, _ = env.reset(seed=episode, options=reset)
        for _ in range(steps):
            explores = random.random_sample() < epsilon(episode / episodes)
            torque = TORQUES[random.randint(41)] if explores else act(observation)
            observation, *_ = env.step(np.array([torque]))
    return env


def buffer_of(recorder: kp.Recorder) -> tuple[Any, ...]:
    """Returns (s, a, r, s′, done) of a program that stores what happened, with indices."""
    steps = recorder.steps
    index = np.abs(steps.action[:, None] - TORQUES).argmin(axis=1)
    return steps.observation, index, steps.reward, steps.next_observation, steps.terminated
