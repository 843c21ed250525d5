from __future__ import annotations

import os
import subprocess
import sys
from typing import Any

import pytest

import keras_pendulum as kp
from keras_pendulum.command_line import (
    OneLineParser,
    add_config_flags,
    setting_from_text,
    typed_settings,
)


def test_a_reader_that_has_gone_ends_a_command_without_a_word() -> None:
    code = (
        "import sys\n"
        "from keras_pendulum.command_line import run_command\n"
        "sys.exit(run_command(lambda: print('a line') or 0))\n"
    )
    # Without a buffer there would be nothing left to complain of at the end.
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


def typed(*words: str) -> dict[str, Any]:
    parser = OneLineParser()
    add_config_flags(parser)
    return typed_settings(parser.parse_args(list(words)))


@pytest.mark.parametrize(
    ("field", "text", "value"),
    [
        ("gradient_clip", "none", None),
        ("gradient_clip", "5", 5.0),
        ("gravity", "none", None),
        ("discount", "1e-1", 0.1),
        ("hidden_units", "16,8", (16, 8)),
        ("seed", "7", 7),
        ("loss", "huber", "huber"),
    ],
)
def test_a_setting_is_read_alike_from_a_flag_and_from_a_text(
    field: str, text: str, value: object
) -> None:
    flag = f"--{field.replace('_', '-')}"
    assert typed(flag, text) == {field: value}
    assert setting_from_text(field, text) == value


@pytest.mark.parametrize("field", ["discount", "episodes"])
def test_none_is_refused_where_a_setting_must_be(
    field: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit, match="2"):
        typed(f"--{field}", "none")
    assert "value: 'none'" in capsys.readouterr().err
    with pytest.raises(kp.ConfigError, match=f"{field} is 'none'; expected"):
        setting_from_text(field, "none")
