"""The repetition of the recorded runs of both listings by `original` and `walkthrough`.

    python -m benchmarks.recorded_run

Trains from the recorded initial weights. Prints for each run how many episodes have identical
actions, averages and printed lines, the largest differences of losses and final weights, and the
duration. It takes ten seconds.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import keras_pendulum as kp
from keras_pendulum.train.loop import train_episodes
from keras_pendulum.train.run import Run, make_run

_DATA = Path(__file__).parents[1] / "tests" / "data"
STEPS = 200  # per episode


def record_torques(run: Run) -> list[np.float32]:
    """Returns a list that grows by the torque (N·m) of each step of the run.

    The replay buffer of `walkthrough` stores other actions than those taken: `index-truncation`.
    """
    torques: list[np.float32] = []
    to_env_action = run.actions.to_env_action

    def recording(index: int) -> Any:
        action = to_env_action(index)
        torques.append(np.float32(action[0]))
        return action

    run.actions.to_env_action = recording  # type: ignore[method-assign]
    return torques


def recorded_torques(recorded: dict[str, NDArray[Any]]) -> NDArray[np.float32]:
    """Returns the torque (N·m) of each step of the recorded run."""
    if "action" in recorded:
        return recorded["action"]
    return np.linspace(-2, 2, 41)[recorded["action_index"]].astype(np.float32)


def repeat(preset: str) -> None:
    """Repeats the recorded run of a preset and prints the comparison."""
    with np.load(_DATA / f"{preset}_run_seed1.npz") as arrays:
        recorded = dict(arrays)
    lines = (_DATA / f"{preset}_run_seed1.log").read_text("utf-8").splitlines()
    expected_torques = recorded_torques(recorded)
    config = kp.preset(preset, seed=1)
    initial = kp.DQN(config.hidden_units)
    initial.set_weights([recorded[f"initial_weight_{i}"] for i in range(8)])

    started = time.perf_counter()
    run = make_run(config, initial)
    torques = record_torques(run)
    identical = 0  # counts up to the first episode with a difference
    for record in train_episodes(run):
        steps = slice(record.environment_steps - STEPS, record.environment_steps)
        identical += (
            identical == record.episode
            and record.line() == lines[record.episode]
            and record.average_reward == recorded["average_reward"][record.episode]
            and np.array_equal(torques[steps], expected_torques[steps])
        )
    seconds = time.perf_counter() - started

    print(f"{preset}: identical episodes, from the first on: {identical} of {len(lines)}")
    if "loss" in recorded:
        losses = np.array([record.loss for record in run.history if not np.isnan(record.loss)])
        difference = np.abs(losses / recorded["loss"] - 1).max()
        print(f"{preset}: largest relative difference of a loss: {difference:.1e}")
    weights = run.agent.online.get_weights()
    difference = max(
        np.abs(actual - recorded[f"final_weight_{i}"]).max() for i, actual in enumerate(weights)
    )
    print(f"{preset}: largest difference of a final weight: {difference:.1e}")
    print(f"{preset}: duration: {seconds:.1f} s")


def main() -> None:
    """Repeats both recorded runs."""
    for preset in ("original", "walkthrough"):
        repeat(preset)


if __name__ == "__main__":
    main()
