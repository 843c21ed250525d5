"""A run that another process interrupts by SIGINT."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import command_line

from keras_pendulum.storage.recorded_run import load_recorded_run
from keras_pendulum.train.checkpoint import load_checkpoint

if sys.platform == "win32":
    pytest.skip("one process cannot send SIGINT to another", allow_module_level=True)


def test_control_c_saves_a_checkpoint_and_exits_130(tmp_path: Path) -> None:
    arguments = ["--preset", "original", "--hidden-units", "8", "--out", str(tmp_path / "run")]
    with subprocess.Popen(
        command_line("train", *arguments, "--episodes", "100000"),
        cwd=tmp_path,
        env=os.environ,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        lines = []
        for line in process.stdout:
            lines.append(line)
            if line.startswith("Episode: 13,"):
                process.send_signal(signal.SIGINT)
    assert process.returncode == 130
    assert lines[-1].startswith("Continue: python -m keras_pendulum.train --resume")
    config = load_recorded_run(tmp_path / "run" / "pendulum_weight.h5").config
    saved = load_checkpoint(tmp_path / "run" / "pendulum_weight.h5", config)
    printed = [line for line in lines if line.startswith("Episode: ")]
    assert [record.line() + "\n" for record in saved.history] == printed
