"""The repetition of the recorded runs of both listings by `original` and `walkthrough`.

    python -m benchmarks.recorded_runs.pendulum

Trains from the recorded initial weights. Writes for each run how many episodes have identical
actions, averages and printed lines, the largest difference of a loss in these episodes, and that of
a final weight where all episodes are identical. It takes ten seconds.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

import keras_pendulum as kp
from benchmarks.recorded_runs.recording import (
    Recorded,
    initial_weights,
    load_recording,
    printed_lines,
)
from benchmarks.result_files import Row, write
from keras_pendulum.train.loop import train_episodes
from keras_pendulum.train.run import Run, make_run

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


def recorded_torques(recorded: Recorded) -> NDArray[np.float32]:
    """Returns the torque (N·m) of each step of the recorded run."""
    if "action" in recorded:
        return recorded["action"]
    return np.linspace(-2, 2, 41)[recorded["action_index"]].astype(np.float32)


def initial_network(preset: str) -> kp.DQN:
    """Returns the network with which the recorded run of a preset began."""
    network = kp.DQN(kp.preset(preset).hidden_units)
    network.set_weights(initial_weights(load_recording(f"{preset}_run_seed1")))
    return network


def repeat(preset: str) -> Row:
    """Repeats the recorded run of a preset; returns the comparison."""
    recorded = load_recording(f"{preset}_run_seed1")
    lines = printed_lines(f"{preset}_run_seed1")
    expected_torques = recorded_torques(recorded)

    run = make_run(kp.preset(preset, seed=1), initial_network(preset))
    torques = record_torques(run)
    identical = 0  # counts up to the first episode with a difference
    for record in train_episodes(run):
        steps = slice(record.environment_steps - STEPS, record.environment_steps)
        identical += bool(
            identical == record.episode
            and record.line() == lines[record.episode]
            and record.average_reward == recorded["average_reward"][record.episode]
            and np.array_equal(torques[steps], expected_torques[steps])
        )
    losses = np.array([record.loss for record in run.history if not np.isnan(record.loss)])
    same = len(losses) - (len(lines) - identical)  # updates before the first difference
    loss_difference = weight_difference = math.nan
    if "loss" in recorded:
        loss_difference = np.abs(losses[:same] / recorded["loss"][:same] - 1).max()
    if identical == len(lines):
        weight_difference = max(
            np.abs(actual - recorded[f"final_weight_{i}"]).max()
            for i, actual in enumerate(run.agent.online.get_weights())
        )
    return {
        "listing": f"`{preset}`",
        "identical episodes, from the first on": f"{identical} of {len(lines)}",
        "identical actions": identical * STEPS,
        "largest relative difference of a loss until there": _shown(loss_difference),
        "largest difference of a final weight": _shown(weight_difference),
    }


def _shown(difference: float) -> str:
    return "–" if math.isnan(difference) else f"{difference:.1e}"


def main() -> None:
    """Repeats both recorded runs."""
    rows = [repeat(preset) for preset in ("original", "walkthrough")]
    write("recorded_run", "python -m benchmarks.recorded_runs.pendulum", rows)


if __name__ == "__main__":
    main()
