"""The cost of an update and of an environment step beside the work that they cannot avoid.

    python -m benchmarks.speed.inner_loops

Compares an update inside the compiled loop with its bare matrix products in PyTorch (extra
`bench`), both on one thread: forward through the online and the target network, and backward for
weights and inputs. Compares a step of the training loop, policy included, with Gymnasium's step.
The two sides of a row run in turns; the table has medians. It takes a minute.
"""

from __future__ import annotations

import os
import statistics
import time
from collections.abc import Callable
from itertools import pairwise

import numpy as np

import keras_pendulum as kp
from benchmarks.result_files import Row, versions, write
from benchmarks.speed.processes import in_turns
from keras_pendulum.dqn.replay_buffer import Transitions
from keras_pendulum.environments.pendulum import Pendulum
from keras_pendulum.train.loop import train_episodes
from keras_pendulum.train.run import make_run

UPDATES = 200  # in one call, so that the cost of the call itself is negligible
ROUNDS = 25
STEPS = 4000


def seconds(work: Callable[[], object]) -> float:
    """Returns the duration of one call."""
    started = time.perf_counter()
    work()
    return time.perf_counter() - started


def update(batch_size: int) -> Callable[[], object]:
    """Returns a function that makes UPDATES updates of the preset `reference`."""
    config = kp.preset("reference", batch_size=batch_size)
    agent = make_run(config).agent
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
    """Returns a function that computes the matrix products of UPDATES updates."""
    import torch

    torch.set_num_threads(int(os.environ["TF_NUM_INTRAOP_THREADS"]))  # the same as TensorFlow
    config = kp.preset("reference")
    sizes = (3, *config.hidden_units, config.torque_count)
    kernels = [torch.randn(inputs, outputs) for inputs, outputs in pairwise(sizes)]
    features = [torch.randn(batch_size, inputs) for inputs in sizes[:-1]]
    gradients = [torch.randn(batch_size, outputs) for outputs in sizes[1:]]

    def work() -> None:
        for _ in range(UPDATES):
            for _ in ("online", "target"):
                for feature, kernel in zip(features, kernels, strict=True):
                    feature @ kernel
            for feature, gradient in zip(features, gradients, strict=True):
                feature.T @ gradient
            for gradient, kernel in zip(gradients[1:], kernels[1:], strict=True):
                gradient @ kernel.T

    return work


def training_steps() -> Callable[[], object]:
    """Returns a function that makes STEPS greedy steps of the training loop, without updates."""
    config = kp.preset(
        "reference",
        episodes=1_000_000,
        warmup_episodes=1_000_000,
        epsilon_start=0.0,
        epsilon_min=0.0,
    )
    episodes = train_episodes(make_run(config))

    def work() -> None:
        for _ in range(STEPS // config.max_episode_steps):
            next(episodes)

    return work


def environment_steps() -> Callable[[], object]:
    """Returns a function that makes STEPS steps of Gymnasium's environment."""
    env = Pendulum().make_env()
    torque = np.array([0.5])

    def work() -> None:
        for step in range(STEPS):
            if step % 200 == 0:
                env.reset(seed=step)
            env.step(torque)

    return work


def compare(sides: dict[str, Callable[[], object]], count: int) -> dict[str, float]:
    """Returns the median duration in seconds of one of `count` pieces of work, by side."""
    times = in_turns(sides, lambda name, _: seconds(sides[name]) / count, ROUNDS)
    return {name: statistics.median(times[name]) for name in sides}


def main() -> None:
    """Measures and writes the table."""
    rows: list[Row] = []
    for batch_size in (32, 128):
        sides = {"here": update(batch_size), "bare": products(batch_size)}
        for side in sides.values():
            side()  # the first call compiles
        took = compare(sides, UPDATES)
        rows.append(
            {
                "work": f"update, batch {batch_size}",
                "here": f"{1e3 * took['here']:.3f} ms",
                "bare": f"{1e3 * took['bare']:.3f} ms (matrix products)",
                "ratio": round(took["here"] / took["bare"], 2),
            }
        )
    took = compare({"here": training_steps(), "bare": environment_steps()}, STEPS)
    rows.append(
        {
            "work": "environment step with policy",
            "here": f"{1e6 * took['here']:.1f} µs",
            "bare": f"{1e6 * took['bare']:.1f} µs (Gymnasium alone)",
            "ratio": round(took["here"] / took["bare"], 2),
        }
    )
    command = "python -m benchmarks.speed.inner_loops"
    write("inner_loops", command, rows, also=versions(["torch"]))


if __name__ == "__main__":
    main()
