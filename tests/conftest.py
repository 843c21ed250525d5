"""What every test stands on: the recorded run, and the commands as a person starts them."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from keras_pendulum.environment import STEPS_PER_EPISODE, make_environment
from keras_pendulum.replay import ReplayBuffer
from keras_pendulum.torque import TorqueGrid

DATA = Path(__file__).parent / "data"
Recorded = dict[str, NDArray[Any]]
Command = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture(scope="session")
def recorded() -> Recorded:
    """The complete run of the original under Keras 2.15, every draw seeded by 1."""
    with np.load(DATA / "original_run_seed1.npz") as arrays:
        return dict(arrays)


@pytest.fixture(scope="session")
def recorded_memory(recorded: Recorded) -> ReplayBuffer:
    """Every transition of the recorded run, at its step number: its actions, played again."""
    memory = ReplayBuffer(len(recorded["action_index"]))
    env = make_environment("Pendulum-v1", gravity=1.0)
    torques = TorqueGrid(41)
    for step, action in enumerate(recorded["action_index"].tolist()):
        if step % STEPS_PER_EPISODE == 0:
            observation, _ = env.reset(seed=1 if step == 0 else None)
        following, reward, terminated, _, _ = env.step(torques.control(action))
        memory.add(observation, action, float(reward), following, terminated)
        observation = following
    return memory


@pytest.fixture(scope="session")
def recorded_lines() -> list[str]:
    """What that run printed."""
    return (DATA / "original_run_seed1.log").read_text().splitlines()


@pytest.fixture(scope="session")
def recorded_initial_weights(recorded: Recorded, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A weights file with the network that the recorded run started from."""
    import keras_pendulum as kp

    network = kp.DQN()
    network.set_weights([recorded[f"initial_weight_{i}"] for i in range(8)])
    path = tmp_path_factory.mktemp("recorded") / "initial.h5"
    kp.save_weights(network, path)
    return path


@pytest.fixture
def command(tmp_path: Path) -> Command:
    """Runs `python -m keras_pendulum.NAME ARGUMENTS` in an empty folder."""

    def run(
        name: str, *arguments: str | os.PathLike[str], environment: dict[str, str] | None = None
    ) -> subprocess.CompletedProcess[str]:
        done = subprocess.run(
            command_line(name, *arguments),
            cwd=tmp_path,
            env={**os.environ, **(environment or {})},
            capture_output=True,
            text=True,
            timeout=300,
            check=False,
        )
        # The whole tensorflow package, which Keras 2 brings into the environment of the tests,
        # notes that it finds no GPU; tensorflow-cpu is silent (tests/test_packaging.py).
        done.stderr = re.sub(
            r"^(WARNING: All log messages|I\d{4} ).*\n", "", done.stderr, flags=re.M
        )
        return done

    return run


def command_line(name: str, *arguments: str | os.PathLike[str]) -> Sequence[str]:
    """The words that start a command of the package in this interpreter."""
    return [sys.executable, "-m", f"keras_pendulum.{name}", *map(str, arguments)]
