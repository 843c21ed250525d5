"""The command `study`, interrupted by SIGINT to its process group."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import psutil
import pytest
from conftest import running_module, wait_for

if sys.platform == "win32":
    pytest.skip("needs process groups", allow_module_level=True)


def has_worker(process: subprocess.Popen[str]) -> bool:
    with suppress(psutil.NoSuchProcess):  # it has ended meanwhile
        children = psutil.Process(process.pid).children()
        return any("spawn_main" in " ".join(child.cmdline()) for child in children)
    return False


# The first worker needs about so long for its first imports. The test passes at any moment.
@pytest.mark.parametrize("seconds", [0, 0.5])
def test_control_c_stops_at_once_and_says_how_to_continue(seconds: float, tmp_path: Path) -> None:
    folder = tmp_path / "study"
    words = ["--arm", "long: reference episodes=100000", "--seeds", "3", "--out", str(folder)]
    with running_module(
        "keras_pendulum.study",
        *words,
        *("--workers", "3"),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    ) as process:
        wait_for(lambda: has_worker(process))
        time.sleep(seconds)
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does: the workers get it too
        output, _ = process.communicate()  # ends when the workers, which inherited it, have ended
    assert process.returncode == 130
    assert output == (
        f"Interrupted: 0 of 3 runs are in {folder}; run the same command again to continue\n"
    )
