"""The preset `original` against the recorded run of the original program."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
from conftest import Command, Recorded

import keras_pendulum as kp
from keras_pendulum.replay import ReplayBuffer
from keras_pendulum.run import Run

STRICT_EPISODES = 100  # later ones may part on another processor, by a last digit
FIRST_LEARNING_EPISODE = 41


def test_first_100_episodes_repeat_every_action_batch_line_and_loss(
    recorded: Recorded, recorded_lines: list[str], recorded_initial_weights: Path
) -> None:
    config = kp.preset("original", seed=1, episodes=STRICT_EPISODES)
    run = Run(config, kp.load_weights(recorded_initial_weights))
    explored: list[int] = []
    batches: list[list[int]] = []

    draw_action, draw_batch = run.random.action, run.random.batch_positions

    def action(count: int) -> int:
        explored.append(run.replay.added)
        return draw_action(count)

    def batch_positions(stored: int, batch_size: int) -> list[int]:
        positions = draw_batch(stored, batch_size)
        oldest = run.replay.added - stored
        batches.append([oldest + position for position in positions])
        return positions

    run.random.action = action  # type: ignore[method-assign]
    run.random.batch_positions = batch_positions  # type: ignore[method-assign]

    actions = [
        run.replay.at(np.arange(len(run.replay) - 200, len(run.replay))).action
        for _ in run.episodes()
    ]

    steps = STRICT_EPISODES * 200
    updates = STRICT_EPISODES - FIRST_LEARNING_EPISODE
    np.testing.assert_array_equal(np.concatenate(actions), recorded["action_index"][:steps])
    np.testing.assert_array_equal(
        explored, np.flatnonzero(np.unpackbits(recorded["explored"])[:steps])
    )
    np.testing.assert_array_equal(batches, recorded["batch"][:updates])
    assert [record.line() for record in run.history] == recorded_lines[:STRICT_EPISODES]
    np.testing.assert_array_equal(
        [record.average_reward for record in run.history],
        recorded["average_reward"][:STRICT_EPISODES],
    )
    losses = [record.loss for record in run.history[FIRST_LEARNING_EPISODE:]]
    np.testing.assert_allclose(losses, recorded["loss"][:updates], rtol=1e-5)


def test_all_459_updates_on_the_recorded_batches_end_at_the_recorded_weights(
    recorded: Recorded, recorded_memory: ReplayBuffer, recorded_initial_weights: Path
) -> None:
    agent = Run(kp.preset("original", seed=1), kp.load_weights(recorded_initial_weights)).agent

    losses = [agent.update(recorded_memory.at(batch[np.newaxis]))[0] for batch in recorded["batch"]]

    np.testing.assert_allclose(losses, recorded["loss"], rtol=1e-5)
    for i, weights in enumerate(agent.online.get_weights()):
        np.testing.assert_allclose(weights, recorded[f"final_weight_{i}"], rtol=0, atol=1e-5)


def test_the_command_prints_the_recorded_lines(
    command: Command, recorded_lines: list[str], recorded_initial_weights: Path
) -> None:
    done = command(
        "train",
        *("--preset", "original", "--seed", "1", "--init", recorded_initial_weights),
        *("--episodes", str(STRICT_EPISODES)),
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[:STRICT_EPISODES] == recorded_lines[:STRICT_EPISODES]


def test_the_program_as_first_written_prints_the_recorded_lines(recorded_lines: list[str]) -> None:
    """What the benchmarks hold the package against; its episodes 41 to 43 make an update each."""
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks.as_first_written", "44"],
        cwd=Path(__file__).parents[1],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == recorded_lines[:44]


def test_the_recorded_weights_file_gives_the_recorded_q_values(recorded: Recorded) -> None:
    network = kp.load_weights(Path(__file__).parent / "data" / "pendulum_weight.keras2.h5")
    np.testing.assert_allclose(
        network(recorded["probe_observations"]), recorded["probe_q_values"], rtol=0, atol=1e-5
    )
