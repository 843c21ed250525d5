"""The commands on a terminal, behind a redirection, and with names that are no text."""

from __future__ import annotations

import itertools
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import Command, command_line

if sys.platform == "win32":
    pytest.skip("needs a pseudoterminal, a shell and names of bytes", allow_module_level=True)

import pty
import termios


def test_train_shows_one_progress_bar_on_a_terminal(tmp_path: Path) -> None:
    controller, terminal = pty.openpty()
    termios.tcsetwinsize(terminal, (24, 80))
    arguments = ["--preset", "original", "--hidden-units", "8"]
    arguments += ["--episodes", "6", "--warmup-episodes", "2"]
    with subprocess.Popen(
        command_line("train", *arguments),
        cwd=tmp_path,
        env={**os.environ, "TERM": "xterm"},
        stdout=terminal,
        close_fds=True,
    ) as process:
        os.close(terminal)
        output = b""
        try:
            while chunk := os.read(controller, 4096):
                output += chunk
        except OSError:  # raised by Linux when the other end is closed
            pass
    os.close(controller)
    assert process.returncode == 0
    bars, *closing = output.decode().replace("\r\n", "\n").split("\n")
    shown = bars.split("\r")[1:]
    assert {len(line) for line in shown} == {79}  # a wrapped line is not drawn over
    number = r"-?[\d.e-]+"
    figures = rf"return {number} ε 0.85( loss {number})?( \d+ steps/s)?"
    assert re.fullmatch(rf"finished 6/6 ━+ {figures}", shown[-1].rstrip())
    phases = [name for name, _ in itertools.groupby(line.split()[0] for line in shown)]
    assert phases == ["training", "compiling", "training", "evaluating", "finished"]
    assert "0:00 left" not in output.decode()
    assert "\x1b" not in output.decode()
    assert "Episode: " not in output.decode()
    assert "Regret: " in "\n".join(closing)


@pytest.mark.skipif(sys.platform != "linux", reason="macOS has names of text only")
def test_folder_without_a_text_as_name_is_used_but_not_by_tensorboard(
    in_process: Command, tmp_path: Path
) -> None:
    out = os.fsdecode(b"runs/\xff")
    words = ["train", "--preset", "original", "--hidden-units", "8", "--episodes", "2", "--out"]
    done = in_process(*words, out, "--tensorboard")
    assert (done.returncode, done.stdout) == (2, "")
    assert re.fullmatch(r"error: TensorBoard cannot write in .*udcff.*\n", done.stderr)
    assert not (tmp_path / "runs").exists()
    assert in_process(*words, out).returncode == 0
    film, network = os.fsdecode(b"\xff.gif"), f"{out}/pendulum_weight.h5"
    done = in_process("evaluate", network, "--episodes", "1", "--gif", film)
    assert done.returncode == 0, done.stderr
    assert os.listdir(bytes(tmp_path / "runs")) == [b"\xff"]  # noqa: PTH208
    assert (tmp_path / film).exists()


@pytest.mark.skipif(sys.platform != "linux", reason="needs /dev/full")
def test_full_disk_of_the_output_is_one_error_line() -> None:
    # Buffered output, so that the last write fails.
    environment = {name: os.environ[name] for name in os.environ if name != "PYTHONUNBUFFERED"}
    with open("/dev/full", "w", encoding="utf-8") as full:
        done = subprocess.run(
            command_line("__main__"),
            env=environment,
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    assert (done.returncode, done.stderr) == (2, "error: [Errno 28] No space left on device\n")
