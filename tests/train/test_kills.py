"""Runs of the command, killed by SIGKILL, resumed, killed again, and resumed to their end.

This process resumes them for the last time, because it has imported TensorFlow already.
"""

from __future__ import annotations

import math
import subprocess
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest
from conftest import command_line
from short_runs import assert_same_state

import keras_pendulum as kp
from keras_pendulum.config.fields import format_value
from keras_pendulum.storage.run_folder import find_run
from keras_pendulum.train.checkpoint import load_checkpoint
from keras_pendulum.train.evaluations import greedy_regret
from keras_pendulum.train.loop import train_episodes
from keras_pendulum.train.run import make_run

# test_checkpoint resumes runs of other presets, in one process.
RUNS: dict[str, dict[str, Any]] = {
    "original": {},
    "reference": {"evaluate_every": 7, "keep_best": True},
}
SIZES = {"episodes": 36, "warmup_episodes": 12, "hidden_units": (16, 8)}
KILLED_IN = ((1, 11), (12, 30))  # first and last episode of the two kills


def config_of(name: str) -> kp.Config:
    return kp.preset(name, **SIZES, **RUNS[name])


def train_with_two_kills(name: str, folder: Path) -> None:
    """Runs the train command in `folder` and kills it twice."""
    random = Random(name)
    words = ["--preset", name, "--out", str(folder)]
    for setting, value in {**SIZES, **RUNS[name]}.items():
        words += [f"--{setting.replace('_', '-')}", format_value(value)]
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
def resumed_runs(short_ending: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder with the folders of the runs."""
    folder = tmp_path_factory.mktemp("runs")
    with ThreadPoolExecutor(2) as pool:  # each thread waits for processes
        list(pool.map(lambda name: train_with_two_kills(name, folder / name), RUNS))
    for name in RUNS:
        kp.train_dqn(config_of(name), folder / name, resume=True)
    return folder


@pytest.mark.parametrize("name", RUNS)
def test_killed_and_resumed_run_equals_an_uninterrupted_run(name: str, resumed_runs: Path) -> None:
    config, folder = config_of(name), find_run(resumed_runs / name)
    resumed, uninterrupted = load_checkpoint(folder.weights, config), make_run(config)
    regret, best = math.inf, None
    for record in train_episodes(uninterrupted, greedy_regret):
        if record.greedy_regret <= regret:
            regret, best = record.greedy_regret, uninterrupted.agent.online.get_weights()
    assert_same_state(resumed, uninterrupted)
    assert folder.best.exists() == config.keep_best == (best is not None)
    if best is not None:
        np.testing.assert_equal(kp.load_weights(folder.best).get_weights(), best)
