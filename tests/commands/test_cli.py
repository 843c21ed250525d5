"""The command line as a child process."""

from __future__ import annotations

import os
import subprocess
import sys


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
