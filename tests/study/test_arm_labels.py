from __future__ import annotations

from dataclasses import fields
from typing import Any

import pytest

from keras_pendulum.config.config import Config
from keras_pendulum.config.presets import PRESETS
from keras_pendulum.study.arm_labels import describe_setting

pytestmark = pytest.mark.quick


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("updates_per_episode", 1, "one update per episode"),
        ("updates_per_episode", 30, "30 updates per episode"),
        ("target_update", "none", "no target network"),
        ("hidden_units", (64, 64), "layers of 64, 64"),
        ("average_updates", 1500, "weights averaged over 1500 updates"),
        ("average_updates", 1, "no average of the weights"),
        ("double_q", True, "double Q-learning"),
        ("gradient_clip", None, "gradient clip none"),  # a setting without words of its own
    ],
)
def test_setting_is_described_in_words(name: str, value: Any, words: str) -> None:
    assert describe_setting(name, value) == words


@pytest.mark.parametrize("preset", PRESETS)
def test_every_setting_of_a_preset_has_a_description(preset: str) -> None:
    for spec in fields(Config):
        words = describe_setting(spec.name, getattr(PRESETS[preset], spec.name))
        assert words
        assert "_" not in words.replace("_uniform", "")
