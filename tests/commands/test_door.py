"""The command `keras-pendulum`: what it lists, and the commands that it runs."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest
from conftest import ROOT, Refusal

import keras_pendulum as kp
from keras_pendulum import __main__ as door
from keras_pendulum.config.presets import DESCRIPTIONS, PRESETS
from keras_pendulum.storage.load_weights import recorded_return

PACKAGE = Path(kp.__file__).parent


@pytest.fixture(params=["keras-pendulum", "python -m keras_pendulum"])
def program(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """The words that a user types, with `sys.argv` as they set it."""
    as_module = request.param.startswith("python")
    path = PACKAGE / "__main__.py" if as_module else Path(sys.prefix) / "bin" / "keras-pendulum"
    monkeypatch.setattr(sys, "argv", [str(path)])
    return str(request.param)


def test_commands_presets_and_shipped_weights_are_listed(
    program: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert door.main([]) == 0
    shown = capsys.readouterr().out
    assert shown.startswith(f"usage: {program} [COMMAND …]\n")
    assert max(map(len, shown.splitlines())) <= 80
    for name, text in door.COMMANDS.items():
        assert re.search(rf"^  {name} +{re.escape(text)}$", shown, re.MULTILINE)
    for name, text in DESCRIPTIONS.items():
        assert re.search(rf"^  {name} +\S.*  {re.escape(text)}$", shown, re.MULTILINE)
    assert re.search(r"^  swingup +Pendulum-v1, g = 10 ", shown, re.MULTILINE)
    for path in (ROOT / "weights").glob("*.h5"):
        line = rf"^  {path.stem} +\S.* {recorded_return(path):.2f}$"
        assert re.search(line, shown, re.MULTILINE), line
    assert f"keras_pendulum {kp.__version__}" in shown


def test_every_command_and_every_preset_is_listed() -> None:
    rooms = {path.parent.name for path in PACKAGE.glob("*/__main__.py")}
    assert rooms == {door.room(name) for name in door.COMMANDS}
    assert {path.stem for path in (ROOT / "weights").glob("*.h5")} <= set(PRESETS)


def test_version_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="0"):
        door.main(["--version"])
    assert capsys.readouterr().out == f"keras_pendulum {kp.__version__}\n"


@pytest.mark.parametrize("name", door.COMMANDS)
def test_usage_of_a_command_is_what_the_user_typed(
    name: str, program: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit, match="0"):
        door.main([name, "--help"])
    assert capsys.readouterr().out.startswith(f"usage: {program} {name} ")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["evalute", "x.h5"], "unknown command 'evalute'; expected one of train, evaluate, "),
        (["Train"], "; did you mean train?"),
        (["reward"], "study\n"),
        ([""], "unknown command ''"),
        (["\x1b[31m\n"], r"unknown command '\x1b[31m\n'"),
        (["--verison"], "unrecognized arguments: --verison; did you mean --version?"),
        (["train", "--sed", "1"], "unrecognized arguments: --sed 1; did you mean --seed?"),
        (["train", "--episode", "4"], "arguments: --episode 4; did you mean --episodes?"),
        (["train", "cartpole"], "arguments: cartpole; did you mean --preset cartpole?"),
        (["train", "nothing"], "unrecognized arguments: nothing\n"),
        (["help"], "study; did you mean --help?"),
    ],
)
def test_mistyped_command_is_one_error_line_with_the_similar_one(
    words: list[str], message: str, refusal: Refusal
) -> None:
    assert message in refusal(door.main, words)
