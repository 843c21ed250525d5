"""The command line as a child process."""

from __future__ import annotations

import errno
import os
import shutil
import subprocess
import sys
from types import SimpleNamespace
from typing import Any

import pytest

from keras_pendulum import cli


def run(code: str, **options: Any) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-c", code], text=True, check=False, **options)


def test_closed_pipe_ends_a_command_without_a_message() -> None:
    code = (
        "import sys\n"
        "from keras_pendulum.cli import run_command\n"
        "sys.exit(run_command(lambda: print('a line') or 0))\n"
    )
    # Without a buffer, nothing would be left to flush at the end.
    environment = {k: value for k, value in os.environ.items() if k != "PYTHONUNBUFFERED"}
    reader, writer = os.pipe()
    os.close(reader)
    done = run(code, env=environment, stdout=writer, stderr=subprocess.PIPE)
    os.close(writer)
    assert (done.returncode, done.stderr) == (1, "")


def test_closed_pipe_of_windows_ends_a_command_without_a_message(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def write() -> int:
        raise OSError(errno.EINVAL, "Invalid argument")

    windows = SimpleNamespace(platform="win32", stdout=sys.__stdout__, stderr=sys.stderr)
    monkeypatch.setattr(cli, "sys", windows)
    monkeypatch.setattr(os, "dup2", lambda *descriptors: None)
    assert cli.run_command(write) == 1
    assert capfd.readouterr().err == ""


# Prints to both outputs.
COMMAND = """
import sys, warnings
from keras_pendulum import cli
from keras_pendulum.errors import UserError

def command():
    print('θ = ±1, g = 1 m/s² …')
    warnings.warn('ε ≤ γ')
    raise UserError('“δ”')

cli.OneLineParser().parse_args([])
sys.exit(cli.run_command(command))
"""


@pytest.mark.parametrize("encoding", ["cp1252", "cp437", "ascii"])
def test_messages_are_printed_in_any_code_page(encoding: str) -> None:
    environment = {**os.environ, "PYTHONIOENCODING": encoding}
    done = run(COMMAND, env=environment, capture_output=True, encoding=encoding)
    assert done.returncode == 2
    assert "1, g = 1 m/s" in done.stdout
    assert [line.split(":")[0] for line in done.stderr.splitlines()] == ["warning", "error"]


@pytest.mark.parametrize("closed", ["stdout", "stderr"])
def test_closed_output_is_no_error_and_nothing_goes_to_the_other(closed: str) -> None:
    environment = {**os.environ, "PYTHONIOENCODING": "utf-8"}
    code = f"import sys\nsys.{closed} = None\n{COMMAND}"
    done = run(code, env=environment, capture_output=True, encoding="utf-8")
    assert done.returncode == 2
    assert done.stdout == ("" if closed == "stdout" else "θ = ±1, g = 1 m/s² …\n")
    assert done.stderr == ("" if closed == "stderr" else "warning: ε ≤ γ\nerror: “δ”\n")


# Words of `shell_word`. The first three need nothing else in sh, cmd and PowerShell.
WORDS = {
    "runs/reference-seed0/pendulum_weight.h5": "runs/reference-seed0/pendulum_weight.h5",
    "C:/runs/a_1.h5": "C:/runs/a_1.h5",
    "-x": "./-x",
    "my run/a.h5": '"my run/a.h5"',
    "it's": '"it\'s"',
    "a,b;c&d|e(f)~#*?{}": '"a,b;c&d|e(f)~#*?{}"',
    "größe": '"größe"',
    "": '""',
    "- a": '"./- a"',
    # In these, sh would replace something between double quotes.
    'a"b': "'a\"b'",
    "a$HOME": "'a$HOME'",
    "a`b": "'a`b'",
    "a\\b": "'a\\b'",
    "a!b": "'a!b'",
    "a$'b": "'a$'\"'\"'b'",
}


@pytest.mark.parametrize("path", WORDS)
def test_printed_path_is_one_word_of_a_shell(path: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cli, "sys", SimpleNamespace(platform="linux"))
    assert cli.shell_word(path) == WORDS[path]
    if shell := shutil.which("sh"):
        line = f"printf %s {cli.shell_word(path)}"
        printed = subprocess.run([shell, "-c", line], stdout=subprocess.PIPE, check=True).stdout
        assert printed.decode() == (f"./{path}" if path.startswith("-") else path)


def test_printed_path_of_windows_has_slashes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cli, "sys", SimpleNamespace(platform="win32"))
    assert cli.shell_word(r"runs\my run\a.h5") == '"runs/my run/a.h5"'
    assert cli.shell_word(r"C:\runs\a.h5") == "C:/runs/a.h5"
