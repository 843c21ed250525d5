"""Runs of the command, killed by SIGKILL, resumed, killed again, and resumed to their end.

The end is made in this process, which has TensorFlow in it already.
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
from keras_pendulum.checkpoint import load_checkpoint
from keras_pendulum.presets import PRESETS
from keras_pendulum.run import Run
from keras_pendulum.run_folder import RunFolder

SIZES = {"episodes": 56, "hidden_units": (16, 8)}  # learning begins after episode 40
KILLED_IN = ((1, 30), (42, 54))  # episodes, the first and the second time


def killed_twice(name: str, folder: Path) -> None:
    """Trains by the command in `folder`, killed twice on the way."""
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
def ends(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Run]:
    """What is in the last checkpoint of each preset's run."""
    folder = tmp_path_factory.mktemp("runs")
    with ThreadPoolExecutor(2) as pool:  # each waits for processes
        list(pool.map(lambda name: killed_twice(name, folder / name), PRESETS))
    for name in PRESETS:
        kp.train_dqn(kp.preset(name, **SIZES), folder / name, resume=True)
    return {
        name: load_checkpoint(RunFolder(folder / name).weights, kp.preset(name, **SIZES))
        for name in PRESETS
    }


@pytest.mark.parametrize("name", PRESETS)
def test_it_ends_bit_for_bit_like_a_run_never_stopped(name: str, ends: dict[str, Run]) -> None:
    whole = Run(kp.preset(name, **SIZES))
    list(whole.episodes())
    ours, theirs = ends[name], whole
    np.testing.assert_array_equal(
        [record[:-1] for record in ours.history], [record[:-1] for record in theirs.history]
    )
    (our_weights, our_state), (their_weights, their_state) = (
        run.agent.get_state() for run in (ours, theirs)
    )
    for mine, yours in (
        (our_weights, their_weights),
        *((our_state[name].values(), their_state[name].values()) for name in our_state),
        (ours.replay.get_state().values(), theirs.replay.get_state().values()),
    ):
        for array, other in zip(mine, yours, strict=True):
            np.testing.assert_array_equal(array, other)
    assert ours.random.get_state() == theirs.random.get_state()
