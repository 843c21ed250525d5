"""The student's program as first written: a DQN for the inverted pendulum in eager TensorFlow.

    python examples/original.py [EPISODES]

It prints one line per episode (500, three minutes). It does not learn;
docs/why_the_original_does_not_learn.md explains why.

Network, replay buffer, training loop and update are those of the final listing. Added are the seeds
and the initial weights of a recorded run, so that the program prints the lines of that run. Later
lines depend on floating-point rounding: some processors choose another action in episode 294.
"""

from __future__ import annotations

import random
import sys
from collections import deque
from pathlib import Path
from typing import Any

import gymnasium
import keras
import numpy as np
import tensorflow as tf

RECORDED_RUN = Path(__file__).parents[1] / "tests" / "data" / "original_run_seed1.npz"
TORQUES = np.linspace(-2, 2, 41)  # N·m, the actions
BATCH_SIZE = 32
DISCOUNT = 0.9


class Model(keras.Model):
    """A Q-network: three hidden layers with tanh, then a value for each torque."""

    def __init__(self) -> None:
        super().__init__()
        self.hidden_1 = keras.layers.Dense(512, activation="tanh")
        self.hidden_2 = keras.layers.Dense(256, activation="tanh")
        self.hidden_3 = keras.layers.Dense(128, activation="tanh")
        self.q_values = keras.layers.Dense(len(TORQUES))

    def call(self, observation: Any) -> Any:
        """Returns the Q-values [B, 41] of observations [B, 3]."""
        return self.q_values(self.hidden_3(self.hidden_2(self.hidden_1(observation))))


def update(model: Model, optimizer: keras.optimizers.Optimizer, replay_buffer: deque[Any]) -> None:
    """Makes one gradient step from a random batch of transitions."""
    batch = random.sample(replay_buffer, BATCH_SIZE)
    observations = np.array([observation for observation, _, _, _ in batch])
    next_observations = np.array([next_observation for _, _, _, next_observation in batch])
    targets = model(observations).numpy()  # [B, 41]
    next_q = model(next_observations).numpy()  # [B, 41]
    for row, (_, torque, reward, _) in enumerate(batch):
        action = np.where(torque == TORQUES)[0][0]
        targets[row][action] = reward + DISCOUNT * np.max(next_q[row])
    with tf.GradientTape() as tape:
        loss = tf.reduce_mean(tf.square(targets - model(observations)))
    gradients = tape.gradient(loss, model.trainable_variables)
    optimizer.apply_gradients(zip(gradients, model.trainable_variables, strict=True))


def main(episodes: int = 500) -> None:
    """Trains for `episodes` episodes and prints a line for each."""
    env = gymnasium.make("Pendulum-v1", g=1.0)
    model = Model()
    model(np.zeros((1, 3), np.float32))  # the first call creates the weights
    if RECORDED_RUN.exists():
        with np.load(RECORDED_RUN) as recorded:
            model.set_weights([recorded[f"initial_weight_{i}"] for i in range(8)])
    optimizer = keras.optimizers.Adam(1e-3)
    replay_buffer: deque[Any] = deque(maxlen=8000)
    epsilon = 0.9
    np.random.seed(1)
    random.seed(1)
    for episode in range(episodes):
        epsilon = max(0.01, epsilon * 0.99)
        observation, _ = env.reset(seed=1 if episode == 0 else None)
        rewards: list[float] = []
        done = False
        while not done:
            if np.random.rand() <= epsilon:
                torque = np.random.choice(TORQUES)
            else:
                torque = TORQUES[np.argmax(model(observation[np.newaxis])[0])]
            next_observation, reward, terminated, truncated, _ = env.step([torque])
            replay_buffer.append((observation, torque, reward, next_observation))
            rewards.append(float(reward))
            observation = next_observation
            done = terminated or truncated
        if episode > 40:
            update(model, optimizer, replay_buffer)
        print(
            f"Episode: {episode}, Average Reward: {np.mean(rewards):.3f}, Epsilon: {epsilon:.2f}",
            flush=True,
        )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
