"""The commands on a simulated Windows: no POSIX modules, other files, and the code page cp1252."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest
from conftest import TESTS

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="this is Windows, not simulated")

SMALL = ("--preset", "original", "--hidden-units", "8", "--out", "my run")
# Runs several commands in one process.
COMMANDS = """
import json, sys
from keras_pendulum.__main__ import main

for words in json.loads(sys.argv[1]):
    assert main(words) == 0, words
"""


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
        return subprocess.run(
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
            check=False,
        )

    def output(self, *commands: Sequence[str]) -> str:
        """Returns the output of commands that have no error."""
        done = self.run(sys.executable, "-c", COMMANDS, json.dumps(commands))
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


MODULE = """
__package__ = "keras_pendulum.module"
import os, signal, sys
from pathlib import Path
import pytest

for name in ("fcntl", "termios", "pty", "resource"):
    with pytest.raises(ModuleNotFoundError):
        __import__(name, globals())
with pytest.raises(PermissionError):
    os.open(".", os.O_RDONLY)
with open("text", "w") as file:
    file.write("²\\n")
    file.flush()
    if Path("/proc/self/fd").exists():
        with pytest.raises(PermissionError):
            Path("text").replace("other")
Path("text").replace("other")
assert not hasattr(os, "sched_getaffinity") and not hasattr(signal, "pthread_sigmask")
assert (sys.platform, Path("other").read_bytes()) == ("win32", b"\\xb2\\r\\n")
"""


def test_module_of_the_package_finds_nothing_that_windows_lacks(windows: Windows) -> None:
    module = windows.folder / "module.py"
    module.write_text(MODULE, encoding="utf-8")
    done = windows.run(sys.executable, module)
    assert (done.returncode, done.stderr) == (0, "")


def test_run_is_trained_replaced_resumed_compared_and_evaluated(windows: Windows) -> None:
    run = windows.folder / "my run"
    printed = windows.output(
        ["train", *SMALL, "--episodes", "1", "--tensorboard"],
        ["train", *SMALL, "--episodes", "2", "--overwrite"],
        ["train", "--resume", "--episodes", "3", "--out", run.name],
        ["compare", run.name, "--out", "runs.png"],
        ["evaluate", f"{run.name}/pendulum_weight.h5", "--episodes", "2"],
        ["page", "reference", "--out", "page.html"],
    )
    assert 'evaluate "my run/pendulum_weight.h5" --episodes 3 --render\n' in printed
    assert "Episode: 2, " in printed
    history = (run / "history.csv").read_bytes()
    assert [row[:2] for row in history.split(b"\n")] == [b"ep", b"0,", b"1,", b"2,", b""]
    assert not (run / "tensorboard").exists()
    assert "| my run | original |    0 |        3 |" in printed
    assert (windows.folder / "runs.png").read_bytes().startswith(b"\x89PNG")
    assert "Greedy on 2 fixed starts, Pendulum-v1, g = 1: " in printed
    assert "-m keras_pendulum.storage.hdf5_reader " in windows.processes()
    page = windows.folder / "page.html"
    assert page.as_uri() in printed
    assert b"\r" not in page.read_bytes()
    assert "θ" in page.read_text(encoding="utf-8")


def test_study_of_two_runs_is_made_and_continued(windows: Windows) -> None:
    words = ["study", "--arm", "con: original episodes=1 hidden_units=8", "--seeds", "2"]
    printed = windows.output([*words, "--workers", "1"], words)
    assert "2 runs in " in printed
    assert "\n2 of 2 runs are already finished" in printed  # read from the files
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
