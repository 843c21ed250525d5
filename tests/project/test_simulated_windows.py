"""The commands on a simulated Windows: no POSIX modules, other files, and the code page cp1252."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from conftest import TESTS, command_line

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="this is Windows, not simulated")

SMALL = ("--preset", "original", "--hidden-units", "8")


def without_gpu_note(output: str) -> str:
    """Removes the note of the package `tensorflow` for Linux that there is no GPU.

    Keras 2 installs that package in the tests' environment. On Windows it prints no such note, so
    the package removes none there.
    """
    return re.sub(r"^(WARNING: All log messages|I\d{4} ).*\n", "", output, flags=re.M)


class Windows:
    """Commands in a folder, in processes that look like Windows to the package."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.site = folder / "site"
        self.site.mkdir()
        shutil.copy(TESTS / "project" / "simulated_windows.py", self.site / "sitecustomize.py")

    def run(self, *words: str | os.PathLike[str]) -> subprocess.CompletedProcess[str]:
        """Runs a program with an output in cp1252."""
        search_path = [str(self.site), str(TESTS.parent), os.environ.get("PYTHONPATH", "")]
        done = subprocess.run(
            words,
            cwd=self.folder,
            env={
                **os.environ,
                "PYTHONPATH": os.pathsep.join(filter(None, search_path)),
                "PYTHONIOENCODING": "cp1252",
                "XDG_CACHE_HOME": str(self.folder / "cache"),
            },
            capture_output=True,
            encoding="cp1252",
            timeout=300,
            check=False,
        )
        done.stderr = without_gpu_note(done.stderr)
        return done

    def output(self, name: str, *words: str | os.PathLike[str]) -> str:
        """Returns the output of a command that has no error."""
        done = self.run(*command_line(name, *words))
        assert done.returncode == 0, done.stderr
        assert not done.stderr
        return done.stdout

    def processes(self) -> str:
        """Returns the command lines of the processes that imported the package."""
        return (self.site / "processes.txt").read_text(encoding="utf-8")


@pytest.fixture
def windows(tmp_path: Path) -> Iterator[Windows]:
    windows = Windows(tmp_path)
    yield windows
    for file in tmp_path.rglob("*"):
        if file.suffix in (".csv", ".json", ".md"):
            assert b"\r" not in file.read_bytes(), file
    assert not list(tmp_path.rglob("*.tmp"))


def test_module_of_the_package_finds_nothing_that_windows_lacks(windows: Windows) -> None:
    package = windows.folder / "keras_pendulum_module.py"
    package.write_text(
        "__package__ = 'keras_pendulum.module'\n"
        "import os, signal, sys\n"
        "from pathlib import Path\n"
        "missing = []\n"
        "for name in ('fcntl', 'termios', 'pty', 'resource'):\n"
        "    try:\n"
        "        __import__(name, globals())\n"
        "    except ModuleNotFoundError:\n"
        "        missing.append(name)\n"
        "try:\n"
        "    os.open('.', os.O_RDONLY)\n"
        "except PermissionError:\n"
        "    missing.append('a folder')\n"
        "with open('text', 'w') as file:\n"
        "    file.write('²\\n')\n"
        "    file.flush()\n"
        "    try:\n"
        "        Path('text').replace('other')\n"
        "    except PermissionError:\n"
        "        missing.append('an open file')\n"
        "Path('text').replace('other')\n"
        "print(missing, hasattr(os, 'sched_getaffinity'), hasattr(signal, 'pthread_sigmask'))\n"
        "print(sys.platform, Path('other').read_bytes())\n",
        encoding="utf-8",
    )
    done = windows.run(sys.executable, package)
    assert done.stderr == ""
    open_file = ", 'an open file'" if Path("/proc/self/fd").exists() else ""
    assert done.stdout.splitlines() == [
        f"['fcntl', 'termios', 'pty', 'resource', 'a folder'{open_file}] False False",
        r"win32 b'\xb2\r\n'",
    ]


def test_run_is_trained_resumed_replaced_and_evaluated(windows: Windows) -> None:
    run = windows.folder / "my run"
    words = (*SMALL, "--out", run.name)
    printed = windows.output("train", *words, "--episodes", "2", "--tensorboard").splitlines()
    assert printed[-3].endswith('evaluate "my run/pendulum_weight.h5" --episodes 3 --render')
    resumed = windows.output("train", "--resume", "--episodes", "3", "--out", run.name)
    assert resumed.startswith("Episode: 2, ")
    history = (run / "history.csv").read_bytes()
    assert [row[:2] for row in history.split(b"\n")] == [b"ep", b"0,", b"1,", b"2,", b""]
    assert (run / "tensorboard").exists()
    windows.output("train", *words, "--episodes", "1", "--overwrite")
    assert not (run / "tensorboard").exists()
    assert (run / "history.csv").read_bytes().count(b"\n") == 2
    table = windows.output("compare", run.name, "--out", "runs.png")
    assert "| my run | original |    0 |        1 |" in table
    assert (windows.folder / "runs.png").read_bytes().startswith(b"\x89PNG")
    weights = run / "pendulum_weight.h5"
    score = windows.output("evaluate", weights, "--episodes", "2", "--gif", "film.gif")
    assert "g = 1" in score
    assert (windows.folder / "film.gif").read_bytes().startswith(b"GIF8")
    assert "-m keras_pendulum.storage.h5_process\n" in windows.processes()


def test_page_is_written(windows: Windows) -> None:
    printed = windows.output("page", "reference", "--out", "page.html")
    assert (windows.folder / "page.html").as_uri() in printed
    page = (windows.folder / "page.html").read_bytes()
    assert b"\r" not in page
    assert "θ" in page.decode()


def test_study_of_two_runs_is_made_and_continued(windows: Windows) -> None:
    words = ["--arm", "con: original episodes=1 hidden_units=8", "--workers", "2"]
    printed = windows.output("study", *words, "--seeds", "1")
    assert "1 runs in " in printed
    # The study goes on with a second run, beside the files of the first.
    assert "1 of 2 runs are already finished" in windows.output("study", *words, "--seeds", "2")
    study = windows.folder / "studies" / "arm-con"
    assert [file.name for file in sorted((study / "results").rglob("*"))] == [
        "arm-con",
        "arm-con-seed0.json",
        "arm-con-seed1.json",
    ]
    (row,) = json.loads((study / "table.json").read_bytes())["rows"]
    assert (row["arm"], row["runs"]) == ("con", 2)
    assert len((study / "seconds.csv").read_bytes().splitlines()) == 3
    # The workers are simulated too.
    assert "from multiprocessing.spawn import spawn_main" in windows.processes()


def test_wrong_input_is_one_line_in_the_code_page(windows: Windows) -> None:
    done = windows.run(*command_line("evaluate", "größe θ.h5"))
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == (
        r"error: größe \u03b8.h5: no such file; expected a weights file (.h5)" + "\n"
    )
