"""The original as its author wrote it: eager TensorFlow, one `model(...)` call a step. Slow.

    python -m benchmarks.as_first_written [EPISODES]

Kept from the final listing: the network, a deque of tuples, the loop over the batch, and the
update under `GradientTape`. Added: the recorded run's seeds and initial weights, so that the lines
it prints can be held against the record, and the number of lines to print.

It imports nothing of the package. Started by `benchmarks.original_run` it has the package's
settings of TensorFlow (one thread for a product, no oneDNN): no slower, and so both make the same
run. With TensorFlow's own settings its last digits can part it from the record sooner.
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

RECORD = Path(__file__).parents[1] / "tests" / "data" / "original_run_seed1.npz"
TORQUES = np.linspace(-2, 2, 41)
BATCH_SIZE = 32
DISCOUNT = 0.9


class Model(keras.Model):
    """512, 256, 128 with tanh, then a value for each torque."""

    def __init__(self) -> None:
        super().__init__()
        self.first = keras.layers.Dense(512, activation="tanh")
        self.second = keras.layers.Dense(256, activation="tanh")
        self.third = keras.layers.Dense(128, activation="tanh")
        self.values = keras.layers.Dense(len(TORQUES))

    def call(self, observation: Any) -> Any:
        """[B, 3] -> [B, 41]."""
        return self.values(self.third(self.second(self.first(observation))))


def learn(model: Model, optimizer: keras.optimizers.Optimizer, memory: deque[Any]) -> None:
    """One update from one batch, its targets built row by row."""
    batch = random.sample(memory, BATCH_SIZE)
    observations = np.array([observation for observation, _, _, _ in batch])
    following = np.array([observation for _, _, _, observation in batch])
    targets = model(observations).numpy()
    next_values = model(following).numpy()
    for row, (_, torque, reward, _) in enumerate(batch):
        index = np.where(torque == TORQUES)[0][0]
        targets[row][index] = reward + DISCOUNT * np.max(next_values[row])
    with tf.GradientTape() as tape:
        loss = tf.reduce_mean(tf.square(targets - model(observations)))
    gradients = tape.gradient(loss, model.trainable_variables)
    optimizer.apply_gradients(zip(gradients, model.trainable_variables, strict=True))


def main(episodes: int = 500) -> None:
    """Runs the first `episodes` episodes and prints their lines."""
    env = gymnasium.make("Pendulum-v1", g=1.0)
    model = Model()
    model(np.zeros((1, 3), np.float32))
    with np.load(RECORD) as record:
        model.set_weights([record[f"initial_weight_{i}"] for i in range(8)])
    optimizer = keras.optimizers.Adam(1e-3)
    memory: deque[Any] = deque(maxlen=8000)
    epsilon = 0.9
    np.random.seed(1)
    random.seed(1)  # after the network, whose initial weights Keras draws with it
    for episode in range(episodes):
        epsilon = max(0.01, epsilon * 0.99)
        observation, _ = env.reset(seed=1 if episode == 0 else None)
        rewards: list[float] = []
        over = False
        while not over:
            if np.random.rand() <= epsilon:
                torque = np.random.choice(TORQUES)
            else:
                torque = TORQUES[np.argmax(model(observation[np.newaxis])[0])]
            following, reward, terminated, truncated, _ = env.step([torque])
            memory.append((observation, torque, reward, following))
            rewards.append(float(reward))
            observation = following
            over = terminated or truncated
        if episode > 40:
            learn(model, optimizer, memory)
        print(
            f"Episode: {episode}, Average Reward: {np.mean(rewards):.3f}, Epsilon: {epsilon:.2f}",
            flush=True,
        )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
