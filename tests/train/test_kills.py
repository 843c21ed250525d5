"""Runs of the command, killed by SIGKILL, resumed, killed again, and resumed to their end.

This process resumes them for the last time, because it has imported TensorFlow already.
"""

from __future__ import annotations

import subprocess
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from random import Random

import numpy as np
import pytest
from conftest import command_line

import keras_pendulum as kp
from keras_pendulum.config.presets import PRESETS
from keras_pendulum.train.checkpoint import load_checkpoint
from keras_pendulum.train.loop import train_episodes
from keras_pendulum.train.run import Run, make_run
from keras_pendulum.train.run_folder import RunFolder

SIZES = {"episodes": 56, "hidden_units": (16, 8)}  # updates begin after episode 41
KILLED_IN = ((1, 30), (42, 54))  # first and last episode of the two kills


def train_with_two_kills(name: str, folder: Path) -> None:
    """Runs the train command in `folder` and kills it twice."""
    random = Random(name)
    words = ["--preset", name, "--out", str(folder), "--episodes", "56", "--hidden-units", "16,8"]
    for first, last in KILLED_IN:
        with subprocess.Popen(
            command_line("train", *words), stdout=subprocess.PIPE, text=True
        ) as process:
            assert process.stdout is not None
            target = f"Episode: {random.randint(first, last)},"
            assert any(line.startswith(target) for line in process.stdout)
            time.sleep(random.uniform(0, 0.05))
            process.kill()
        words = ["--resume", "--out", str(folder)]


@pytest.fixture(scope="module")
def resumed_runs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Run]:
    """The runs in the last checkpoints, by preset."""
    folder = tmp_path_factory.mktemp("runs")
    with ThreadPoolExecutor(2) as pool:  # each thread waits for processes
        list(pool.map(lambda name: train_with_two_kills(name, folder / name), PRESETS))
    for name in PRESETS:
        kp.train_dqn(kp.preset(name, **SIZES), folder / name, resume=True)
    return {
        name: load_checkpoint(RunFolder(folder / name).weights, kp.preset(name, **SIZES))
        for name in PRESETS
    }


@pytest.mark.parametrize("name", PRESETS)
def test_killed_and_resumed_run_equals_an_uninterrupted_run(
    name: str, resumed_runs: dict[str, Run]
) -> None:
    resumed, uninterrupted = resumed_runs[name], make_run(kp.preset(name, **SIZES))
    list(train_episodes(uninterrupted))
    np.testing.assert_array_equal(
        [record[:-1] for record in resumed.history],
        [record[:-1] for record in uninterrupted.history],
    )
    for found, expected in zip(
        resumed.agent.online.get_weights(), uninterrupted.agent.online.get_weights(), strict=True
    ):
        np.testing.assert_array_equal(found, expected)
    np.testing.assert_equal(resumed.agent.get_state(), uninterrupted.agent.get_state())
    np.testing.assert_equal(resumed.replay.get_state(), uninterrupted.replay.get_state())
    assert resumed.streams.get_state() == uninterrupted.streams.get_state()
