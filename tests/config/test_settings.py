"""Settings by their names: unknown and old names, parsed texts, and what older files record."""

from __future__ import annotations

import json
import re
from typing import Any

import pytest

import keras_pendulum as kp
from keras_pendulum.config.config import Config
from keras_pendulum.config.presets import PRESETS
from keras_pendulum.config.settings import (
    RENAMED,
    parse_setting,
    read_settings,
)

# The settings of version 0.1 that have other names now, and the line that names the new ones.
OLD_NAMES = {
    "update_after": "the setting update_after is now train_frequency (episode or step)",
    "learning_starts": "the setting learning_starts is now warmup_episodes (learning_starts + 1)",
    "target_blend": "the setting target_blend is now tau",
    "bootstrap": "the setting bootstrap is now double_q (true or false)",
    "episode_steps": "the setting episode_steps is now max_episode_steps",
    "remembered_action": "the setting remembered_action is now stored_index (exact or truncated)",
}


def refuse(name: str, line: str) -> None:
    """Requires that the name of a setting is refused with this line everywhere."""
    calls: dict[str, Any] = {
        "parse": lambda: parse_setting(name, "1"),
        "preset": lambda: kp.preset("reference", **{name: 1}),
        "read": lambda: read_settings({**vars(Config()), name: 1}),
    }
    for call in calls.values():
        with pytest.raises(kp.ConfigError, match=f"^{re.escape(line)}$"):
            call()


@pytest.mark.parametrize(("name", "line"), OLD_NAMES.items())
def test_old_name_of_a_setting_is_refused_with_the_new_one(name: str, line: str) -> None:
    refuse(name, line)


def test_old_names_are_those_of_this_file_and_the_new_ones_are_settings() -> None:
    assert RENAMED.keys() == OLD_NAMES.keys()
    assert {new.split()[0] for new in RENAMED.values()} <= Config.__dataclass_fields__.keys()


@pytest.mark.parametrize("name", ["colour", "", "__doc__"])
def test_unknown_setting_is_refused(name: str) -> None:
    refuse(name, f"unknown setting {name}")


@pytest.mark.parametrize(
    ("name", "similar"),
    [
        ("learning_speed", "learning_rate"),
        ("epsiodes", "episodes"),
        ("hiddenUnits", "hidden_units"),
    ],
)
def test_mistyped_setting_is_refused_with_the_similar_one(name: str, similar: str) -> None:
    refuse(name, f"unknown setting {name}; did you mean {similar}?")


@pytest.mark.parametrize(
    ("name", "text", "expected"),
    [
        ("discount", "none", "a number"),
        ("episodes", "1.5", "a whole number"),
        ("hidden_units", "8;4", "whole numbers with commas, such as 64,64"),
        ("double_q", "True", "true or false"),
    ],
)
def test_parse_setting_refuses_text_of_another_kind(name: str, text: str, expected: str) -> None:
    with pytest.raises(kp.ConfigError, match=f"^{name} is '{text}'; expected {expected}$"):
        parse_setting(name, text)


@pytest.mark.parametrize("config", PRESETS.values(), ids=PRESETS)
def test_settings_written_as_json_are_read_again(config: Config) -> None:
    assert read_settings(json.loads(json.dumps(vars(config)))) == config


def test_missing_recorded_setting_has_its_default() -> None:
    assert read_settings({"seed": 3}) == Config(seed=3)
    # The gravity has no default there.
    assert read_settings({"environment": "CartPole-v1"}).gravity is None


@pytest.mark.parametrize(
    ("recorded", "message"),
    [
        ([], "the recorded settings are []; expected a JSON object"),
        ({"episodes": 0}, "episodes is 0; expected a whole number from 1 to 1000000"),
        ({"hidden_units": 8}, "hidden_units is 8; expected 1 to 16 whole numbers"),
        ({"target_update": ["soft"]}, "target_update is ['soft']; expected one of"),
        ({"target_update": {}}, "target_update is {}; expected one of"),
        ({"gravity": None}, "gravity is missing; environment Pendulum-v1 needs it"),
    ],
)
def test_recorded_settings_that_no_run_can_have_are_refused(recorded: Any, message: str) -> None:
    with pytest.raises(kp.ConfigError, match=f"^{re.escape(message)}"):
        read_settings(recorded)
