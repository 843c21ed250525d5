"""What every test stands on: the recorded run, and the commands as a person starts them."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from numpy.typing import NDArray

from keras_pendulum.environment import STEPS_PER_EPISODE, make_environment
from keras_pendulum.replay import ReplayBuffer
from keras_pendulum.torque import TorqueGrid

if TYPE_CHECKING:
    import keras_pendulum as kp

DATA = Path(__file__).parent / "data"
Recorded = dict[str, NDArray[Any]]
Command = Callable[..., subprocess.CompletedProcess[str]]
Refusal = Callable[[Callable[[list[str]], int], Sequence[object]], str]


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
        done.stderr = without_gpu_note(done.stderr)
        return done

    return run


@pytest.fixture
def refusal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Refusal:
    """The one line that a command's `main` says to words it must refuse.

    It is called in a folder with a file `text.h5`, which it must leave as it is.
    """
    (tmp_path / "text.h5").write_text("not weights")
    monkeypatch.chdir(tmp_path)

    def told(main: Callable[[list[str]], int], words: Sequence[object]) -> str:
        try:
            status = main([str(word) for word in words])
        except SystemExit as exit:  # argparse leaves by itself
            assert isinstance(exit.code, int)
            status = exit.code
        printed = capsys.readouterr()
        assert (status, printed.out) == (2, "")
        assert printed.err.startswith("error: ")
        assert printed.err.count("\n") == 1
        assert [file.name for file in tmp_path.iterdir()] == ["text.h5"]
        assert (tmp_path / "text.h5").read_text() == "not weights"
        return printed.err

    return told


def without_gpu_note(output: str) -> str:
    """What a process printed, but for the note of the whole tensorflow package: it finds no GPU.

    Keras 2 brings that package into the tests' environment; tensorflow-cpu is silent
    (tests/test_packaging.py).
    """
    return re.sub(r"^(WARNING: All log messages|I\d{4} ).*\n", "", output, flags=re.M)


def command_line(name: str, *arguments: str | os.PathLike[str]) -> Sequence[str]:
    """The words that start a command of the package in this interpreter."""
    return [sys.executable, "-m", f"keras_pendulum.{name}", *map(str, arguments)]


def comparable(result: kp.TrainingResult) -> list[tuple[float, ...]]:
    """The history but for its wall-clock times."""
    return [
        tuple(-1.0 if np.isnan(value) else value for value in record[:-1])
        for record in result.history
    ]


def assert_same(ours: kp.TrainingResult, theirs: kp.TrainingResult) -> None:
    assert comparable(ours) == comparable(theirs)
    for mine, yours in zip(ours.network.get_weights(), theirs.network.get_weights(), strict=True):
        np.testing.assert_array_equal(mine, yours)
