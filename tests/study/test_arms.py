"""The arms of the default study and the user's own arms."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import pytest

import keras_pendulum as kp
from keras_pendulum.compare.curve_style import STYLES
from keras_pendulum.errors import ConfigError
from keras_pendulum.study.arms import default_arms, own_arms


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


def test_each_curve_of_the_default_study_has_its_own_colour() -> None:
    assert len([arm for arm in default_arms() if arm.has_curve]) <= len(STYLES)


def test_arms_that_differ_only_in_save_every_share_their_runs() -> None:
    one, two, three = own_arms(
        ["reference"], ["seldom: reference save_every=7", "less: reference discount=0.5"]
    )
    assert one.config != two.config
    assert one.training_config == two.training_config != three.training_config


def test_own_arm_is_a_preset_with_settings() -> None:
    one, two, three = own_arms(
        ["reference", "cartpole"], ["small: reference hidden_units=8,4 gravity=1 discount=0.5"]
    )
    assert three.config == kp.preset("reference", hidden_units=(8, 4), discount=0.5)
    assert (one.baseline, two.baseline, three.baseline) == (None, None, "reference")


def test_arm_with_a_name_of_64_letters_is_accepted() -> None:
    (arm,) = own_arms([], [f"{'n' * 64}: original"])
    assert arm.slug == "n" * 64


@pytest.mark.parametrize("name", ["con", "NUL", "aux", "Prn", "com1", "lpt9.5", "nul.", "com0 "])
def test_arm_with_a_name_that_windows_reserves_has_another_one_in_file_names(name: str) -> None:
    (arm,) = own_arms([], [f"{name}: original"])
    assert arm.name == name.strip()
    assert arm.slug == f"arm-{name.lower().strip(' .')}"


@pytest.mark.parametrize("name", ["console", "nul-1", "com", "com10", "a.con", "prn1"])
def test_arm_with_a_name_that_windows_allows_keeps_it_in_file_names(name: str) -> None:
    (arm,) = own_arms([], [f"{name}: original"])
    assert arm.slug == name


def test_arm_with_letters_that_windows_forbids_has_others_in_file_names() -> None:
    (arm,) = own_arms([], ['a<b>c"d|e?f*g/h\\i. . : original'])
    assert arm.slug == "a-b-c-d-e-f-g-h-i"


def test_reserved_name_and_its_replacement_are_two_arms_of_one_name() -> None:
    with pytest.raises(ConfigError, match="two arms have the name"):
        own_arms([], ["con: original", "arm-con: reference"])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("nothing", "is not of the form"),
        ("a: nonsense", "unknown preset 'nonsense'"),
        ("a: refrence", "did you mean reference"),
        ("a: reference colour=red", "unknown setting colour$"),
        ("a: reference batchsize=8", "unknown setting batchsize; did you mean batch_size"),
        ("a: reference environment=CartPole-v1", "take the preset cartpole"),
        ("a: reference episodes=ten", "episodes is 'ten'; expected a whole number"),
        ("a: reference episodes=-1", "episodes is -1"),
        ("a: reference episodes", "expected field=value"),
        ("a: reference seed=3", "cannot set seed"),
        ("a: reference evaluate_every=50", "cannot set evaluate_every: a study evaluates each run"),
        ("a: reference keep_best=true", "cannot set keep_best"),
        ("a: reference snapshots=20", "cannot set snapshots"),
        ("reference: original", "two arms have the name"),
        (f"{'n' * 65}: original", "longer than 64 letters"),
    ],
)
def test_wrong_arm_is_a_config_error_of_one_line(text: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message) as caught:
        own_arms(["reference"], [text])
    assert "\n" not in str(caught.value)
