"""Fixtures of several rooms: the recorded run, and commands as a user starts them."""

from __future__ import annotations

import contextlib
import functools
import importlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import IO, Any

import keras_pendulum as kp  # isort: skip  # before NumPy, which reads its variables
import numpy as np
import pytest
from numpy.typing import NDArray

from keras_pendulum.dqn.replay_buffer import ReplayBuffer, Transitions
from keras_pendulum.environments.actions import TorqueGrid
from keras_pendulum.environments.pendulum import STEPS_PER_EPISODE, Pendulum

pytest_plugins = ("page_fixtures",)
TESTS = Path(__file__).parent
ROOT = TESTS.parent
DATA = TESTS / "data"
# `pytest -m quick` runs the tests of these rooms, and the files of other rooms that are marked
# `quick`: no training over 5 s, no browser, no build.
QUICK_ROOMS = ("dqn", "config", "environments", "storage")
Recorded = dict[str, NDArray[Any]]
Command = Callable[..., subprocess.CompletedProcess[str]]
Refusal = Callable[[Callable[[list[str]], int], Sequence[object]], str]


# The threads of torch wait for each other with all their power where other tests need the cores.
os.environ["OMP_NUM_THREADS"] = "1"
# A shell starts a background job with Ctrl-C ignored, and so would every command in the tests.
signal.signal(signal.SIGINT, signal.default_int_handler)
# Libraries ask the standard input for its encoding, and pytest has none where it is closed.
if sys.__stdin__ is None:
    sys.__stdin__ = open(os.devnull, encoding="utf-8")  # type: ignore[misc]  # noqa: SIM115


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Marks the quick tests. A test of a command is none: its process imports TensorFlow."""
    for item in items:
        is_slow = item.get_closest_marker("slow") or "command" in getattr(item, "fixturenames", ())
        if item.path.parent.name in QUICK_ROOMS and not is_slow:
            item.add_marker("quick")


@pytest.fixture(scope="session")
def recorded() -> Recorded:
    """The arrays of the recorded run of the original under Keras 2.15, with seed 1."""
    with np.load(DATA / "original_run_seed1.npz") as arrays:
        return dict(arrays)


@pytest.fixture(scope="session")
def recorded_transitions(recorded: Recorded) -> Transitions:
    """All transitions [100000] of the recorded run, made by taking its actions again."""
    replay = ReplayBuffer(len(recorded["action_index"]), observation_size=3)
    env = Pendulum().make_env()
    torques = TorqueGrid(41)
    for step, action in enumerate(recorded["action_index"].tolist()):
        if step % STEPS_PER_EPISODE == 0:
            observation, _ = env.reset(seed=1 if step == 0 else None)
        next_observation, reward, terminated, _, _ = env.step(torques.to_env_action(action))
        replay.add(observation, action, float(reward), next_observation, terminated)
        observation = next_observation
    return replay.transitions()


@pytest.fixture
def files_read_here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Reads HDF5 files in this process, which is faster than in one for each file.

    For files that harm nothing: test_hostile_files.py loads those for which the process is needed.
    """
    from keras_pendulum.errors import WeightsError
    from keras_pendulum.storage.hdf5_reader import copy_content

    def read(file: IO[bytes], output: IO[bytes], seconds: float) -> None:
        try:
            copy_content(file, os.fstat(file.fileno()).st_size, output)  # type: ignore[arg-type]
        except WeightsError as error:
            output.write(json.dumps({"error": str(error)}).encode())

    monkeypatch.setattr("keras_pendulum.storage.quarantine._run_reader", read)


@pytest.fixture
def optimum_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder for exact results, which does not exist yet."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "keras_pendulum"


@pytest.fixture
def command(tmp_path: Path) -> Command:
    """Runs `python -m keras_pendulum.NAME ARGUMENTS` in an empty folder."""

    def run(
        name: str, *arguments: str | os.PathLike[str], environment: dict[str, str] | None = None
    ) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            command_line(name, *arguments),
            cwd=tmp_path,
            env={**os.environ, **(environment or {})},
            capture_output=True,
            text=True,
            check=False,
        )

    return run


@pytest.fixture
def in_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Iterator[Command]:
    """Runs a command as `command` does, but in this process, which is much faster."""
    monkeypatch.chdir(tmp_path)

    def run(
        name: str, *arguments: object, environment: dict[str, str] | None = None
    ) -> subprocess.CompletedProcess[str]:
        words = [str(argument) for argument in arguments]
        with environment_restored():
            os.environ.update(environment or {})
            room = "diagnosis" if name == "diagnose" else name
            main = importlib.import_module(f"keras_pendulum.{room}.__main__").main
            status = status_of(main, words)
        printed = capsys.readouterr()
        return subprocess.CompletedProcess(words, status, printed.out, printed.err)

    yield run
    if "pygame" in sys.modules:  # a command with a window has started it
        sys.modules["pygame"].quit()


def status_of(main: Callable[[list[str]], int], words: list[str]) -> int:
    """Returns the exit status of a command, which runs in this process."""
    try:
        return main(words)
    except SystemExit as exit:  # raised by argparse
        assert isinstance(exit.code, int)
        return exit.code


@contextlib.contextmanager
def environment_restored() -> Iterator[None]:
    """Restores the environment variables at the end of the `with` block."""
    before = dict(os.environ)
    try:
        yield
    finally:
        os.environ.clear()
        os.environ.update(before)


@pytest.fixture
def refusal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Refusal:
    """Returns the one line that a command's `main` prints for arguments that it refuses.

    The command runs in a folder with a file `text.h5`, in which it must not change anything.
    """
    (tmp_path / "text.h5").write_text("not weights")
    monkeypatch.chdir(tmp_path)

    def content() -> dict[Path, bytes | None]:
        return {path: path.read_bytes() if path.is_file() else None for path in tmp_path.rglob("*")}

    def error_line(main: Callable[[list[str]], int], words: Sequence[object]) -> str:
        before = content()
        status = status_of(main, [str(word) for word in words])
        printed = capsys.readouterr()
        assert (status, printed.out) == (2, "")
        assert printed.err.startswith("error: ")
        assert printed.err.count("\n") == 1
        assert content() == before
        return printed.err

    return error_line


@contextlib.contextmanager
def ending_shortly(starts: int = 2) -> Iterator[None]:
    """Ends a run with the score of a few starts and with a picture of a few bytes.

    Those of a user take longer than a short training.
    """
    train_dqn = importlib.import_module("keras_pendulum.train.train_dqn")
    score_of = functools.partial(train_dqn.evaluate_policy, episodes=starts)
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(train_dqn, "evaluate_policy", score_of)
        # The optimum of another number of steps takes many seconds.
        patched.setattr(
            "keras_pendulum.train.reference_returns.reference_returns", lambda config: {}
        )
        patched.setattr("keras_pendulum.optimum.phase_plane.run_phase_planes", lambda *run: {})
        patched.setattr("keras_pendulum.figures.run_figure.draw_run", lambda *run: b"a picture")
        yield


@pytest.fixture(scope="module")
def short_ending() -> Iterator[None]:
    """Ends the runs shortly in all tests of a file, from the first that names it."""
    with ending_shortly():
        yield


def command_line(name: str, *arguments: str | os.PathLike[str]) -> Sequence[str]:
    """Returns the words that start a command of the package in this interpreter."""
    return [sys.executable, "-m", f"keras_pendulum.{name}", *map(str, arguments)]


def wait_for(condition: Callable[[], object]) -> None:
    """Returns when the condition is true. A wait without end fails by the limit in setup.cfg."""
    while not condition():
        time.sleep(0.02)


def comparable(result: kp.TrainingResult) -> list[tuple[float, ...]]:
    """Returns the history without its wall-clock times."""
    return [
        tuple(-1.0 if np.isnan(value) else value for value in record._replace(seconds=0.0))
        for record in result.history
    ]


# Runs the module `sys.argv[1]`. When the parent process ends, even by SIGKILL, the system closes
# its end of the pipe at stdin, and this process ends too.
_END_WITH_PARENT = """
import os, runpy, sys, threading

def end_with_parent():
    os.read(0, 1)
    os._exit(1)

threading.Thread(target=end_with_parent, daemon=True).start()
runpy.run_module(sys.argv.pop(1), run_name="__main__", alter_sys=True)
"""


@contextlib.contextmanager
def running_module(
    module: str, *words: str | os.PathLike[str], **options: Any
) -> Iterator[subprocess.Popen[Any]]:
    """Yields a process of `python -m MODULE WORDS`, and kills it at the end of the `with` block.

    It ends with this process too. `options` are those of `subprocess.Popen`.
    """
    reading, writing = os.pipe()
    arguments = [sys.executable, "-c", _END_WITH_PARENT, module, *map(str, words)]
    try:
        with subprocess.Popen(arguments, stdin=reading, **options) as process:
            try:
                yield process
            finally:
                process.kill()
    finally:
        os.close(reading)
        os.close(writing)


def assert_same(ours: kp.TrainingResult, theirs: kp.TrainingResult) -> None:
    assert comparable(ours) == comparable(theirs)
    for mine, yours in zip(ours.network.get_weights(), theirs.network.get_weights(), strict=True):
        np.testing.assert_array_equal(mine, yours)
