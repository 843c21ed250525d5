"""What an update and an environment step cost, beside what they cannot do without.

    python -m benchmarks.inner_loops

An update inside the compiled loop against its bare matrix products in PyTorch (extra `bench`), both
on one thread: forward through the online and the target network, then backward for weights and
inputs. And a step of the acting loop, policy included, against Gymnasium's step alone. Medians, the
two sides of a row in turns.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from itertools import pairwise

import numpy as np

import keras_pendulum as kp
from benchmarks.report import median, versions, write
from keras_pendulum.environment import make_environment
from keras_pendulum.replay import Transitions
from keras_pendulum.run import Run

UPDATES = 200  # in one call: what the call itself costs no longer counts
ROUNDS = 25


def seconds(work: Callable[[], object]) -> float:
    """How long one call takes."""
    started = time.perf_counter()
    work()
    return time.perf_counter() - started


def update(batch_size: int) -> Callable[[], object]:
    """UPDATES updates of the preset `reference`, with batches of another size."""
    config = kp.preset("reference", batch_size=batch_size, updates_per_episode=UPDATES)
    agent = Run(config).agent
    random = np.random.default_rng(0)
    shape = (UPDATES, batch_size)
    batches = Transitions(
        observation=random.normal(size=(*shape, 3)).astype(np.float32),
        action=random.integers(config.torque_count, size=shape, dtype=np.int32),
        reward=random.normal(size=shape).astype(np.float32),
        next_observation=random.normal(size=(*shape, 3)).astype(np.float32),
        terminated=np.zeros(shape, bool),
    )
    return lambda: agent.update(batches)


def products(batch_size: int) -> Callable[[], object]:
    """The matrix products of as many updates, and nothing else."""
    import torch

    torch.set_num_threads(int(os.environ["TF_NUM_INTRAOP_THREADS"]))  # as TensorFlow has
    config = kp.preset("reference")
    sizes = (3, *config.hidden_units, config.torque_count)
    kernels = [torch.randn(a, b) for a, b in pairwise(sizes)]
    inputs = [torch.randn(batch_size, a) for a in sizes[:-1]]
    slopes = [torch.randn(batch_size, b) for b in sizes[1:]]

    def work() -> None:
        for _ in range(UPDATES):
            for _ in ("online", "target"):
                for features, kernel in zip(inputs, kernels, strict=True):
                    features @ kernel
            for features, slope in zip(inputs, slopes, strict=True):
                features.T @ slope
            for slope, kernel in zip(slopes[1:], kernels[1:], strict=True):
                slope @ kernel.T

    return work


def acting(steps: int) -> Callable[[], object]:
    """Greedy steps of the acting loop: policy, environment, replay buffer."""
    config = kp.preset(
        "reference",
        episodes=1_000_000,
        learning_starts=1_000_000,
        epsilon_start=0.0,
        epsilon_min=0.0,
    )
    episodes = Run(config).episodes()

    def work() -> None:
        for _ in range(steps // config.episode_steps):
            next(episodes)

    return work


def environment(steps: int) -> Callable[[], object]:
    """Steps of Gymnasium's environment alone."""
    env = make_environment("Pendulum-v1", 1.0)
    torque = np.array([0.5])

    def work() -> None:
        for step in range(steps):
            if step % 200 == 0:
                env.reset(seed=step)
            env.step(torque)

    return work


def main() -> None:
    """Measures and writes the table."""
    rows = []
    for batch_size in (32, 128):
        sides = [update(batch_size), products(batch_size)]
        for side in sides:
            side()  # compiles
        times = [[seconds(side) / UPDATES * 1e3 for side in sides] for _ in range(ROUNDS)]
        ours, bare = (median(column, 4) for column in zip(*times, strict=True))
        rows.append(
            {
                "work": f"update, batch {batch_size}",
                "here": f"{ours:.3f} ms",
                "bare": f"{bare:.3f} ms (matrix products)",
                "ratio": round(ours / bare, 2),
            }
        )
    steps = 4000
    both = [acting(steps), environment(steps)]
    times = [[seconds(side) / steps * 1e6 for side in both] for _ in range(ROUNDS)]
    ours, bare = (median(column, 2) for column in zip(*times, strict=True))
    rows.append(
        {
            "work": "environment step with policy",
            "here": f"{ours:.1f} µs",
            "bare": f"{bare:.1f} µs (Gymnasium alone)",
            "ratio": round(ours / bare, 2),
        }
    )
    write("inner_loops", "python -m benchmarks.inner_loops", rows, also=versions(["torch"]))


if __name__ == "__main__":
    main()
