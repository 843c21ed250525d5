"""The arms of the default study and the user's own arms."""

from __future__ import annotations

from dataclasses import fields, replace
from itertools import pairwise
from typing import Any

import pytest

import keras_pendulum as kp
from keras_pendulum.config.presets import PRESETS
from keras_pendulum.errors import ConfigError
from keras_pendulum.study.arms import default_arms, describe_setting, own_arms, study_name


def test_default_study_goes_from_original_to_reference_one_change_at_a_time() -> None:
    arms = {arm.name: arm for arm in default_arms()}
    ladder = list(arms.values())[: list(arms).index("reference") + 1]
    assert ladder[0].config == kp.preset("original")
    assert replace(ladder[-1].config, preset="reference") == kp.preset("reference")
    for before, after in pairwise(ladder):
        changed = [
            name
            for name in kp.Config.__dataclass_fields__
            if getattr(before.config, name) != getattr(after.config, name)
        ]
        assert len(changed) == 1
        assert after.baseline == before.name


def test_default_study_leaves_each_change_out_of_reference() -> None:
    arms = default_arms()
    left_out = [arm for arm in arms if arm.name.startswith("reference without ")]
    assert len(left_out) == len([arm for arm in arms if arm.name.startswith("+")]) + 1
    assert all(arm.baseline == "reference" for arm in left_out)
    assert len({arm.training_config for arm in arms}) == len(arms) - 1
    assert len({arm.slug for arm in arms}) == len(arms)


def test_arms_that_differ_only_in_their_preset_share_their_runs() -> None:
    one, two, three = own_arms(
        ["reference"],
        [
            "fixed: original max_episode_steps=100 replay_capacity=14000 updates_per_episode=40 "
            "learning_rate_schedule=cosine target_update=soft",
            "less: reference discount=0.5",
        ],
    )
    assert one.config != two.config
    assert one.training_config == two.training_config != three.training_config


def test_own_arm_is_a_preset_with_settings() -> None:
    one, two, three = own_arms(
        ["reference", "cartpole"], ["small: reference hidden_units=8,4 gravity=1 discount=0.5"]
    )
    assert three.config == kp.preset("reference", hidden_units=(8, 4), discount=0.5)
    assert (one.baseline, two.baseline, three.baseline) == (None, None, "reference")


@pytest.mark.parametrize(
    ("name", "slug"),
    [
        *((name, f"arm-{name}") for name in ("con", "aux", "com1", "lpt9.5")),
        ("NUL", "arm-nul"),
        ("Prn", "arm-prn"),
        ("nul.", "arm-nul"),
        ("com0 ", "arm-com0"),
        *((name, name) for name in ("console", "nul-1", "com", "com10", "a.con", "prn1")),
        ("n" * 64, "n" * 64),
        ('a<b>c"d|e?f*g/h\\i. . ', "a-b-c-d-e-f-g-h-i"),
    ],
)
def test_name_of_an_arm_in_file_names_is_allowed_on_windows(name: str, slug: str) -> None:
    (arm,) = own_arms([], [f"{name}: original"])
    assert (arm.name, arm.slug) == (name.strip(), slug)


def test_folder_of_a_study_has_the_names_of_its_arms_and_at_most_150_letters() -> None:
    def name_of(*names: str) -> str:
        return study_name(own_arms([], [f"{name}: reference" for name in names]))

    assert name_of("a" * 64) == "a" * 22  # the paths of its results have the arm's name twice
    assert name_of("a" * 37, "b" * 35) == f"{'a' * 37}-vs-{'b' * 35}"  # 76 letters
    assert name_of("a" * 37, "b" * 36) == f"{'a' * 37}-vs-{'b' * 35}"  # one letter is cut
    # A name that ends with a dot is another one on Windows.
    assert name_of("a" * 37, f"{'b' * 34}.5") == f"{'a' * 37}-vs-{'b' * 34}"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("nothing", "is not of the form"),
        ("a: nonsense", "unknown preset 'nonsense'"),
        ("a: reference colour=red", "unknown setting colour$"),
        ("a: reference batchsize=8", "unknown setting batchsize; did you mean batch_size"),
        ("a: reference episodes=-1", "episodes is -1"),
        ("a: reference episodes", "expected field=value"),
        ("a: reference tau=0.1 tau=0.2", "the arm 'a' sets tau twice"),
        ("a: reference seed=3", "cannot set seed"),
        ("a: reference evaluate_every=50", "cannot set evaluate_every: a study evaluates each run"),
        ("a: reference save_every=7", "cannot set save_every: .* saves no weights$"),
        ("a: reference keep_best=true", "cannot set keep_best"),
        ("a: reference snapshots=20", "cannot set snapshots"),
        ("reference: original", "two arms have the name"),
        ("Reference?: original", "two arms have the name"),
        (f"{'n' * 65}: original", "longer than 64 letters"),
    ],
)
def test_wrong_arm_is_a_config_error_of_one_line(text: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message) as caught:
        own_arms(["reference"], [text])
    assert "\n" not in str(caught.value)


@pytest.mark.quick
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


@pytest.mark.quick
@pytest.mark.parametrize("preset", PRESETS)
def test_every_setting_of_a_preset_has_a_description(preset: str) -> None:
    for spec in fields(kp.Config):
        words = describe_setting(spec.name, getattr(PRESETS[preset], spec.name))
        assert words
        assert "_" not in words.replace("_uniform", "")
