"""The cost of `kp.Recorder` for each step, beside Gymnasium's own recorder of returns.

    python -m benchmarks.speed.recorder [RUNS]

Times 20 000 steps of Pendulum-v1, alone and with each wrapper, and of a vector environment of four.
The loops run in turns, 7 of each; the table has their medians.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np

import keras_pendulum as kp
from benchmarks.result_files import write
from benchmarks.speed.processes import in_turns, median

STEPS = 20_000
WRAPPERS: dict[str, tuple[Callable[[Any], Any], Callable[[Any], Any]]] = {
    "none": (lambda env: env, lambda env: env),
    "RecordEpisodeStatistics": (
        gymnasium.wrappers.RecordEpisodeStatistics,
        gymnasium.wrappers.vector.RecordEpisodeStatistics,
    ),
    "kp.Recorder": (kp.Recorder, kp.Recorder),
}


def seconds_of(env: Any, action: Any) -> float:
    """Returns the seconds of all steps, with the resets of an environment that needs them."""
    env.reset(seed=0)
    is_vector = action.ndim > 1
    began = time.perf_counter()
    for _ in range(STEPS):
        _, _, terminated, truncated, _ = env.step(action)
        if not is_vector and (terminated or truncated):
            env.reset()
    return time.perf_counter() - began


def measure(name: str) -> tuple[float, float]:
    """Returns the microseconds of a step, of one environment and of four."""
    single, vector = WRAPPERS[name]
    one = seconds_of(single(gymnasium.make("Pendulum-v1")), np.zeros(1, np.float32))
    envs = gymnasium.make_vec("Pendulum-v1", 4)
    return one / STEPS * 1e6, seconds_of(vector(envs), np.zeros((4, 1), np.float32)) / STEPS * 1e6


def main(runs: int = 7) -> None:
    """Runs the loops and writes the table."""
    measured = in_turns(WRAPPERS, lambda name, _: measure(name), runs)
    rows = [
        {
            "wrapper": name,
            "µs for a step": median([one for one, _ in times], 1),
            "µs for a step of four environments": median([four for _, four in times], 1),
            "runs": runs,
        }
        for name, times in measured.items()
    ]
    write("recorder", "python -m benchmarks.speed.recorder", rows)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
