"""The command line as a child process."""

from __future__ import annotations

import errno
import os
import shutil
import subprocess
import sys
from types import SimpleNamespace

import pytest

from keras_pendulum import cli


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
    done = subprocess.run(
        [sys.executable, "-c", code],
        env=environment,
        stdout=writer,
        stderr=subprocess.PIPE,
        text=True,
        check=False,
    )
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


@pytest.mark.parametrize("encoding", ["cp1252", "cp437", "ascii"])
def test_messages_are_printed_in_any_code_page(encoding: str) -> None:
    code = (
        "import sys, warnings\n"
        "from keras_pendulum import cli\n"
        "from keras_pendulum.errors import UserError\n"
        "def command():\n"
        "    print('θ = ±1, g = 1 m/s² …')\n"
        "    warnings.warn('ε ≤ γ')\n"
        "    raise UserError('“δ”')\n"
        "cli.OneLineParser().parse_args([])\n"
        "sys.exit(cli.run_command(command))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "PYTHONIOENCODING": encoding},
        capture_output=True,
        encoding=encoding,
        check=False,
    )
    assert done.returncode == 2
    assert "1, g = 1 m/s" in done.stdout
    assert [line.split(":")[0] for line in done.stderr.splitlines()] == ["warning", "error"]


@pytest.mark.parametrize("closed", ["stdout", "stderr"])
def test_closed_output_is_no_error_and_nothing_goes_to_the_other(closed: str) -> None:
    code = (
        "import sys\n"
        "from keras_pendulum import cli\n"
        "from keras_pendulum.errors import UserError\n"
        f"sys.{closed} = None\n"
        "def command():\n"
        "    print('to stdout')\n"
        "    raise UserError('to stderr')\n"
        "cli.OneLineParser().parse_args([])\n"
        "sys.exit(cli.run_command(command))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    expected = {"stdout": ("", "error: to stderr\n"), "stderr": ("to stdout\n", "")}
    assert (done.stdout, done.stderr) == expected[closed]


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
