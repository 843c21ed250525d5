"""The command `study`, interrupted by SIGINT to its process group."""

from __future__ import annotations

import os
import signal
import sys
import time
from pathlib import Path

import psutil
import pytest
from test_study import STUDY, running, wait_for, workers_of

if sys.platform == "win32":
    pytest.skip("needs process groups", allow_module_level=True)


# The first worker needs about so long for its first imports.
@pytest.mark.parametrize("seconds", [0, 0.05, 0.5])
def test_control_c_stops_at_once_and_says_how_to_continue(seconds: float, tmp_path: Path) -> None:
    folder = tmp_path / "study"
    words = ["--arm", "long: reference episodes=100000", "--seeds", "8", "--out", str(folder)]
    with running(STUDY, *words, "--workers", "8", own_group=True) as process:
        wait_for(lambda: workers_of(process))
        time.sleep(seconds)
        workers = workers_of(process)
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does: the workers get it too
        output = process.communicate(timeout=60)[0]
        _, alive = psutil.wait_procs(workers, 60)
    assert [worker for worker in alive if worker.status() != psutil.STATUS_ZOMBIE] == []
    assert process.returncode == 130
    assert output == (
        f"Interrupted: 0 of 8 runs are in {folder}; run the same command again to continue\n"
    )
