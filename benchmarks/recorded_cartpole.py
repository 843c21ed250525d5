"""How far the preset `cartpole-original` repeats a recorded run of the PyTorch program.

    python -m benchmarks.recorded_cartpole

The run was recorded by tests/torch_cartpole.py, with the same draws and ε placed alike.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import keras_pendulum as kp
from keras_pendulum.network import Origin
from keras_pendulum.run import Run

RECORD = Path(__file__).parents[1] / "tests" / "data" / "cartpole_torch_run_seed0.npz"


def recorded_episodes(recorded: dict[str, NDArray[Any]]) -> list[NDArray[Any]]:
    """The actions of each episode."""
    steps = recorded["steps"]
    actions = np.unpackbits(recorded["actions"], count=int(steps.sum()))
    return np.split(actions, np.cumsum(steps)[:-1])


def repeated_episodes(recorded: dict[str, NDArray[Any]]) -> Iterator[NDArray[Any]]:
    """The actions of each episode of this package's run from the same initial weights."""
    config = kp.preset(
        "cartpole-original", seed=int(recorded["seed"]), episodes=len(recorded["steps"])
    )
    initial = kp.DQN(
        config.hidden_units,
        2,
        observation_size=4,
        activation=config.activation,
        origin=Origin(config.environment),
    )
    initial.set_weights([recorded[f"initial_weight_{i}"] for i in range(6)])
    run = Run(config, initial)
    for record in run.episodes():
        steps = int(record.episode_return)
        yield run.replay.at(np.arange(len(run.replay) - steps, len(run.replay))).action


def main() -> None:
    """Runs the preset until its actions are no longer those of the record."""
    with np.load(RECORD) as arrays:
        recorded = dict(arrays)
    episodes = recorded_episodes(recorded)
    identical = steps = 0
    for ours, theirs in zip(repeated_episodes(recorded), episodes, strict=True):
        if not np.array_equal(ours, theirs):
            same = min(len(ours), len(theirs))
            steps += int(np.argmin(np.append(ours[:same] == theirs[:same], False)))
            break
        identical += 1
        steps += len(theirs)
    print(f"identical episodes, from the first on: {identical} of {len(episodes)}")
    print(f"identical actions, from the first on: {steps} of {sum(map(len, episodes))}")


if __name__ == "__main__":
    main()
