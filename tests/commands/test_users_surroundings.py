"""Commands in a user's own surroundings: code that prints or exits, variables, forks."""

from __future__ import annotations

import json
import multiprocessing
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from conftest import Command

import keras_pendulum as kp
from keras_pendulum.status import status

NOISY = """
import os
print("loading")
os.system("echo loaded")

def agent(observation):
    print("a step")
    return 0.0
"""


def write(folder: Path, code: str) -> None:
    (folder / "mine.py").write_text(code)


def test_json_is_all_of_the_output(tmp_path: Path, in_process: Command) -> None:
    write(tmp_path, NOISY)
    result = in_process("evaluate", "mine.py:agent", "--json", "--episodes", "1")
    assert result.returncode == 0, result.stderr
    assert json.loads(result.stdout)["regret"] > 0
    assert "loading" in result.stderr
    assert "a step" in result.stderr


def test_json_of_a_process_is_all_of_the_output(tmp_path: Path, command: Command) -> None:
    """Matplotlib's backend of another environment, an output in ASCII, and a noisy child."""
    write(tmp_path, NOISY + "import atexit\natexit.register(print, 'the end')\n")
    surroundings = {
        "MPLBACKEND": "module://nowhere.backend",
        "LC_ALL": "C",
        "PYTHONUTF8": "0",
        "PYTHONCOERCECLOCALE": "0",
        "_ARGCOMPLETE_OF_ANOTHER_PROGRAM": "1",
    }
    result = command("diagnose", "mine.py:agent", "--json", environment=surroundings)
    assert result.returncode == 0, result.stderr
    assert json.loads(result.stdout)["agent"] == "mine.py:agent"
    assert "loaded" in result.stderr
    assert "the end" in result.stderr


@pytest.mark.parametrize("name", ["evaluate", "diagnose"])
@pytest.mark.parametrize(
    "code",
    [
        "import sys; sys.exit(0)",
        "import argparse; argparse.ArgumentParser().parse_args(['--unknown'])",
        "def agent(observation): raise SystemExit(0)",
    ],
    ids=["exit", "argparse", "in a step"],
)
def test_code_that_exits_is_an_error(
    code: str, name: str, tmp_path: Path, in_process: Command
) -> None:
    write(tmp_path, code)
    result = in_process(name, "mine.py:agent")
    assert (result.returncode, result.stdout) == (2, "")
    assert "raised SystemExit: " in result.stderr.splitlines()[-1]
    assert result.stderr.splitlines()[-1].startswith("error: ")


@pytest.mark.parametrize(
    "code",
    [
        "class A:\n    @property\n    def predict(self): raise SystemExit(0)\nagent = A()",
        "class A:\n    def __array__(self): raise SystemExit(0)\ndef agent(o): return A()",
        "def __getattr__(name): raise SystemExit(0)",
        "import asyncio\ndef agent(observation): raise asyncio.CancelledError('stop')",
        "raise BaseException('stop')",
    ],
    ids=["property", "answer", "module", "cancelled", "base"],
)
def test_code_that_ends_in_any_other_way_is_one_error_line(
    code: str, tmp_path: Path, in_process: Command
) -> None:
    write(tmp_path, code)
    result = in_process("evaluate", "mine.py:agent", "--episodes", "1")
    assert (result.returncode, result.stdout) == (2, "")
    assert result.stderr.startswith("error: ")
    assert result.stderr.count("\n") == 1


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")
def test_training_in_a_fork_is_refused() -> None:
    """TensorFlow's threads are not in the fork, and its operations would wait for them."""
    context: Any = multiprocessing.get_context("fork")
    queue = context.Queue()

    def train() -> None:
        try:
            kp.train_dqn(kp.preset(episodes=1))
        except kp.UserError as error:
            queue.put(str(error))

    process = context.Process(target=train)
    process.start()
    assert 'multiprocessing.get_context("spawn")' in queue.get()
    process.join()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")
def test_fork_loads_and_evaluates() -> None:
    context: Any = multiprocessing.get_context("fork")
    queue = context.Queue()
    process = context.Process(
        target=lambda: queue.put(kp.evaluate_policy("reference", episodes=1).regret)
    )
    process.start()
    assert queue.get() == kp.evaluate_policy("reference", episodes=1).regret
    process.join()


def test_window_without_a_display_is_one_error(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER"):
        monkeypatch.delenv(name, raising=False)
    if sys.platform != "linux":
        pytest.skip("only Linux has systems without a display")
    for show in (
        lambda: kp.evaluate_policy("reference", episodes=1, render_mode="human"),
        lambda: kp.train_dqn(kp.preset(episodes=1), render=True),
    ):
        with pytest.raises(kp.UserError, match="there is no display"):
            show()


@pytest.mark.skipif(sys.platform != "linux", reason="SDL has no other way there")
def test_import_makes_sdl_draw_without_opengl() -> None:
    """Together with TensorFlow, the OpenGL of SDL's first window ends in a segmentation fault."""
    environment = {name: os.environ[name] for name in os.environ if not name.startswith("SDL_")}
    code = "import keras_pendulum, os; print(os.environ['SDL_FRAMEBUFFER_ACCELERATION'])"
    process = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
    )
    assert process.stdout == "0\n"


def test_status_is_shown_on_a_terminal_only(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    times = iter(range(0, 100, 2))
    monkeypatch.setattr("time.monotonic", lambda: next(times))
    with status("Working") as report:
        report(0.5)
    assert capsys.readouterr().err == ""
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    with status("Working") as report:
        for share in (0.25, 0.5):
            report(share)
    shown = [line.rstrip() for line in capsys.readouterr().err.split("\r")]
    assert [line for line in shown if line] == ["Working …", "Working … 50%"]
