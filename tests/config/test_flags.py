"""The flags of the settings: what a user types, and what `--help` prints."""

from __future__ import annotations

import re
from dataclasses import fields
from typing import Any

import pytest

import keras_pendulum as kp
from keras_pendulum.cli import OneLineParser
from keras_pendulum.config.config import Config
from keras_pendulum.config.fields import format_value
from keras_pendulum.config.flags import add_config_flags, settings_from_args
from keras_pendulum.config.presets import PRESETS
from keras_pendulum.config.settings import RENAMED

SETTINGS = [spec.name for spec in fields(Config) if spec.name != "preset"]


def flag(setting: str) -> str:
    return f"--{setting.replace('_', '-')}"


def make_parser() -> OneLineParser:
    parser = OneLineParser(help_all=True)
    add_config_flags(parser)
    return parser


def typed(*words: str) -> dict[str, Any]:
    return settings_from_args(make_parser().parse_args(list(words)))


def error_line(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    """Returns the one line that is printed for words that are refused."""
    with pytest.raises(SystemExit) as exit:
        typed(*words)
    printed = capsys.readouterr()
    assert (exit.value.code, printed.out) == (2, "")
    assert printed.err.count("\n") == 1
    return printed.err.removesuffix("\n")


@pytest.fixture
def help_lines(monkeypatch: pytest.MonkeyPatch) -> dict[str, str]:
    """The help text of each flag, on one line."""
    monkeypatch.setenv("COLUMNS", "1000")  # no line breaks within a help text
    parser = make_parser()
    parser.show_hidden()
    return flags_in(parser.format_help())


def flags_in(shown: str) -> dict[str, str]:
    """Returns the help text of each flag by its name, without `--help-all`."""
    _, *flags = shown.split("\n  --")
    texts = {f"--{text.split()[0]}": " ".join(text.split()) for text in flags}
    texts.pop("--help-all")
    return texts


def test_flags_that_are_not_typed_stay_unset() -> None:
    assert typed() == {}


def test_switch_without_a_value_is_true() -> None:
    assert typed("--keep-best", "--evaluate-every", "5") == {"keep_best": True, "evaluate_every": 5}
    assert typed("--double-q", "--keep-best", "false") == {"double_q": True, "keep_best": False}
    assert typed("--double-q", "true") == {"double_q": True}


@pytest.mark.parametrize("name", SETTINGS)
def test_every_setting_of_every_preset_can_be_typed(name: str) -> None:
    for config in PRESETS.values():
        value = getattr(config, name)
        found = typed(flag(name), format_value(value))
        assert found == {name: value}
        assert type(found[name]) is type(value)


def test_unknown_choice_is_refused_with_the_choices(capsys: pytest.CaptureFixture[str]) -> None:
    line = error_line(capsys, "--target-update", "sometimes")
    assert line.startswith("error: argument --target-update: invalid choice: 'sometimes'")
    assert re.search("soft.*hard.*none", line)


@pytest.mark.parametrize("name", RENAMED)
def test_old_flag_is_refused_with_the_new_one(name: str) -> None:
    for words in ([flag(name), "1"], [f"{flag(name)}=none"]):
        with pytest.raises(kp.ConfigError, match=f"^the setting {name} is now "):
            typed(*words)


def test_short_help_shows_ten_settings_and_those_of_the_recording() -> None:
    shown = set(flags_in(make_parser().format_help()))
    assert shown > {"--save-every", "--evaluate-every", "--keep-best", "--snapshots"}
    assert len(shown) == 10 + 4
    assert shown >= {"--episodes", "--seed", "--gravity", "--learning-rate", "--hidden-units"}


def test_help_all_prints_every_setting_and_exits(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="0"):
        typed("--help-all")
    assert set(flags_in(capsys.readouterr().out)) == {flag(name) for name in SETTINGS}


@pytest.mark.parametrize("name", SETTINGS)
def test_mistyped_flag_is_refused_with_the_similar_one(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    for words in ([f"{flag(name)}x", "1"], [f"{flag(name)}x=1"]):
        assert error_line(capsys, *words) == (
            f"error: unrecognized arguments: {' '.join(words)}; did you mean {flag(name)}?"
        )


@pytest.mark.parametrize(
    ("name", "values", "defaults"),
    [
        ("episodes", "N", "[reference: 500, cartpole-original: 600]"),
        ("replay_capacity", "N", "[reference: 14000, original: 8000, cartpole-original: 10000]"),
        ("gravity", "N", "[reference: 1.0, cartpole-original: none]"),
        ("hidden_units", "N,N,…", "[reference: 512,256,128, cartpole-original: 128,128]"),
        ("loss", "{squared,huber}", "[reference: squared, cartpole-original: huber]"),
        ("double_q", "[{true,false}]", "[reference: false]"),
    ],
)
def test_help_shows_the_values_and_the_defaults_of_the_reference_and_of_the_originals(
    name: str, values: str, defaults: str, help_lines: dict[str, str]
) -> None:
    assert help_lines[flag(name)].split()[1] == values
    assert help_lines[flag(name)].endswith(f" {defaults}")


@pytest.mark.parametrize("name", SETTINGS)
def test_help_of_every_setting_has_its_text_and_the_default(
    name: str, help_lines: dict[str, str]
) -> None:
    line = help_lines[flag(name)]
    assert Config.__dataclass_fields__[name].metadata["help"] in line
    assert f"[reference: {format_value(getattr(PRESETS['reference'], name))}" in line
