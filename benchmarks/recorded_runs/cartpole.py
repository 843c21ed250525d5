"""The repetition of a recorded run in PyTorch by the preset `cartpole-original`.

    python -m benchmarks.recorded_runs.cartpole

Writes how many episodes and actions are identical. tests/torch/torch_cartpole.py recorded the run,
with the same random draws and with Adam's ε in the same place. It takes ten seconds.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

import keras_pendulum as kp
from benchmarks.recorded_runs.recording import Recorded, initial_weights, load_recording
from benchmarks.result_files import write
from keras_pendulum.train.loop import train_episodes
from keras_pendulum.train.run import make_run

RECORDING = "cartpole_torch_run_seed0"


def recorded_episodes(recorded: Recorded) -> list[NDArray[Any]]:
    """Returns the actions of each episode of the recorded run."""
    steps = recorded["steps"]
    actions = np.unpackbits(recorded["actions"], count=int(steps.sum()))
    return np.split(actions, np.cumsum(steps)[:-1])


def repeated_episodes(recorded: Recorded) -> Iterator[NDArray[Any]]:
    """Trains from the recorded initial weights; yields the actions of each episode."""
    config = kp.preset(
        "cartpole-original", seed=int(recorded["seed"]), episodes=len(recorded["steps"])
    )
    initial = kp.DQN(
        config.hidden_units,
        2,
        observation_size=4,
        activation=config.activation,
        metadata={"environment": config.environment},
    )
    initial.set_weights(initial_weights(recorded))
    run = make_run(config, initial)
    for record in train_episodes(run):
        yield run.replay.transitions().action[-int(record.episode_return) :]


def main() -> None:
    """Trains until an action differs from the recorded one."""
    recorded = load_recording(RECORDING)
    recorded_actions = recorded_episodes(recorded)
    identical = steps = 0
    for actual, expected in zip(repeated_episodes(recorded), recorded_actions, strict=True):
        if not np.array_equal(actual, expected):
            common = min(len(actual), len(expected))
            steps += int(np.argmin(np.append(actual[:common] == expected[:common], False)))
            break
        identical += 1
        steps += len(expected)
    row = {
        "identical episodes, from the first on": f"{identical} of {len(recorded_actions)}",
        "identical actions, from the first on": f"{steps} of {sum(map(len, recorded_actions))}",
    }
    write("recorded_cartpole", "python -m benchmarks.recorded_runs.cartpole", [row])


if __name__ == "__main__":
    main()
