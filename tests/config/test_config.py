"""The Config: the range of each setting, and the settings that exclude each other."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

import keras_pendulum as kp
from keras_pendulum.config.config import Config
from keras_pendulum.config.fields import Integer, Number, kind_of
from keras_pendulum.config.settings import RENAMED, parse_setting, validate_setting

INF, NAN = float("inf"), float("nan")
# The lowest and the highest value of each number.
LIMITS: dict[str, tuple[float, float]] = {
    "gravity": (0, 100),
    "episodes": (1, 1_000_000),
    "max_episode_steps": (1, 10_000),
    "seed": (0, 2**32 - 1),
    "torque_count": (2, 1001),
    "replay_capacity": (1, 10_000_000),
    "batch_size": (1, 65_536),
    "discount": (0, 1),
    "reward_scale": (1e-6, 1e6),
    "epsilon_start": (0, 1),
    "epsilon_decay": (0, 1),
    "epsilon_decay_steps": (1, 1e9),
    "epsilon_min": (0, 1),
    "warmup_episodes": (0, 1_000_000),
    "updates_per_episode": (1, 10_000),
    "optimizer_epsilon": (0, 1),
    "weight_decay": (0, 1),
    "gradient_clip": (1e-9, 1e9),
    "learning_rate": (1e-9, 10),
    "learning_rate_min": (0, 10),
    "average_updates": (1, 1_000_000),
    "tau": (0, 1),
    "target_period": (1, 1_000_000),
    "save_every": (1, 1_000_000),
    "evaluate_every": (0, 1_000_000),
    "snapshots": (0, 100),
}


def test_every_setting_has_a_help_text() -> None:
    for spec in dataclasses.fields(Config):
        assert len(spec.metadata["help"]) > 5, spec.name


def test_every_number_has_its_limits_in_this_file() -> None:
    numbers = [spec for spec in dataclasses.fields(Config) if isinstance(kind_of(spec), Number)]
    assert {spec.name for spec in numbers} == set(LIMITS)


@pytest.mark.parametrize("name", LIMITS)
def test_limits_are_accepted_and_the_next_number_is_refused(name: str) -> None:
    kind: Any = kind_of(Config.__dataclass_fields__[name])
    low, high = LIMITS[name]
    assert (validate_setting(name, low), validate_setting(name, high)) == (low, high)
    too_low, too_high = np.nextafter([low, high], [-INF, INF]).tolist()
    if isinstance(kind, Integer):
        too_low, too_high = int(low) - 1, int(high) + 1
    for value in (too_low, too_high):
        with pytest.raises(kp.ConfigError, match=f"^{name} is .*; expected a .*number from"):
            validate_setting(name, value)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *[("gravity", value) for value in (-1.0, NAN, INF, 101.0)],
        *[("episodes", value) for value in (0, -5, 10**9)],
        *[("seed", value) for value in (-1, 2**32)],
        *[("hidden_units", value) for value in ((), (0,), (8193,), (10**6,), (8,) * 17)],
        *[("torque_count", value) for value in (0, 1, 10**6)],
        *[("replay_capacity", value) for value in (0, -1, 10**12)],
        *[("batch_size", value) for value in (0, 10**9)],
        *[("discount", value) for value in (-0.1, 1.1, NAN)],
        *[("epsilon_start", value) for value in (-0.1, 1.1, NAN)],
        *[("learning_rate", value) for value in (0.0, -1e-3, NAN, INF, 1e9)],
        *[("updates_per_episode", value) for value in (0, -1)],
        *[("tau", value) for value in (-0.1, 1.5, NAN)],
        *[("target_update", value) for value in ("", "sometimes")],
        *[("learning_rate_schedule", value) for value in ("linear",)],
        *[("train_frequency", value) for value in ("reset", "steps")],
        *[("environment", value) for value in ("Acrobot-v1", "Nonsense-v0")],
        *[("save_every", value) for value in (0, -1)],
        *[("episodes", value) for value in (1.5, True, "12", None, (5,))],
        *[("gravity", value) for value in (True, "1", None, (0.5,))],
        *[("hidden_units", value) for value in (8, "8", None, (8.5,), (8, "8"))],
        *[("target_update", value) for value in (5, None, ("soft",))],
        *[("double_q", value) for value in ("true", 1, None)],
    ],
)
def test_value_out_of_range_is_refused_with_its_setting(name: str, value: Any) -> None:
    with pytest.raises(kp.ConfigError, match=f"^{name} "):
        kp.preset("reference", **{name: value})


def test_number_beyond_all_floats_is_refused() -> None:
    with pytest.raises(kp.ConfigError, match=r"^learning_rate is 1000"):
        kp.preset("reference", learning_rate=10**400)


def test_numpy_numbers_and_lists_are_stored_as_python_values() -> None:
    changed = kp.preset(
        "reference", episodes=np.int64(9), gravity=np.float32(2), hidden_units=[8, np.int32(4)]
    )
    plain = kp.preset("reference", episodes=9, gravity=2, hidden_units=(8, 4))
    assert changed == plain
    assert (type(changed.episodes), type(changed.gravity)) == (int, float)
    assert [type(units) for units in changed.hidden_units] == [int, int]


def test_config_cannot_be_changed() -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        Config().episodes = 3  # type: ignore[misc]


@pytest.mark.parametrize("name", RENAMED)
def test_renamed_setting_is_refused_with_its_new_name(name: str) -> None:
    message = f"^the setting {name} is now "
    with pytest.raises(kp.ConfigError, match=message):
        parse_setting(name, "1")
    with pytest.raises(kp.ConfigError, match=message):
        validate_setting(name, 1)
    new_name = RENAMED[name].split()[0]
    assert new_name in Config.__dataclass_fields__


def test_unknown_setting_is_refused() -> None:
    for name in ("colour", "", "__doc__"):
        with pytest.raises(kp.ConfigError, match=f"^unknown setting {name}$"):
            parse_setting(name, "1")
        with pytest.raises(kp.ConfigError, match=f"^unknown setting {name}$"):
            validate_setting(name, 1)


@pytest.mark.parametrize(
    ("name", "text", "expected"),
    [
        ("discount", "none", "a number"),
        ("episodes", "none", "a whole number"),
        ("episodes", "1.5", "a whole number"),
        ("hidden_units", "8;4", "whole numbers with commas, such as 64,64"),
        ("double_q", "1", "true or false"),
    ],
)
def test_parse_setting_refuses_text_of_another_kind(name: str, text: str, expected: str) -> None:
    with pytest.raises(kp.ConfigError, match=f"^{name} is '{text}'; expected {expected}$"):
        parse_setting(name, text)


def test_checkpoint_too_large_to_load_is_refused() -> None:
    with pytest.raises(kp.ConfigError, match=r"checkpoint of 1\.0 GiB; the limit is 1 GiB"):
        kp.preset("reference", hidden_units=(8192, 8192))
    with pytest.raises(kp.ConfigError, match=r"make a checkpoint of 1\.2 GiB"):
        kp.preset("cartpole-original", hidden_units=(8000, 7000), replay_capacity=4_000_000)
    assert kp.preset("reference", hidden_units=(8192, 6000)).hidden_units == (8192, 6000)


def test_largest_checkpoint_is_accepted_and_a_larger_one_is_refused() -> None:
    # 49 436 809 weights in 4 copies, 33 bytes for each transition and 64 for each episode are
    # 1 GiB - 1 MiB, which leaves 1 MiB for the rest of the file.
    assert 16 * 49_436_809 + 33 * 8_535_792 + 64 * 362 == 1_073_741_824 - 1_048_576
    largest = kp.preset(
        "reference", hidden_units=(8192, 6000), replay_capacity=8_535_792, episodes=362
    )
    larger: list[dict[str, Any]] = [
        {"replay_capacity": 8_535_793},
        {"episodes": 363},
        {"torque_count": 42},
        {"optimizer": "adamw"},
        {"average_updates": 2},
    ]
    for changes in larger:
        with pytest.raises(kp.ConfigError, match=r"make a checkpoint of .* the limit is 1 GiB"):
            dataclasses.replace(largest, **changes)


def test_largest_checkpoint_of_cartpole_has_41_bytes_for_each_transition() -> None:
    # 49 210 962 weights in 5 copies.
    assert 20 * 49_210_962 + 41 * 2_157_848 + 64 * 35 == 1_073_741_824 - 1_048_576
    largest = kp.preset(
        "cartpole-original", hidden_units=(8192, 6000), replay_capacity=2_157_848, episodes=35
    )
    with pytest.raises(kp.ConfigError, match=r"make a checkpoint of .* the limit is 1 GiB"):
        dataclasses.replace(largest, replay_capacity=2_157_849)


def test_1_and_16_hidden_layers_of_1_to_8192_units_are_accepted() -> None:
    accepted: list[tuple[int, ...]] = [(1,), (8192,), (8,) * 16]
    for units in accepted:
        assert kp.preset("reference", hidden_units=units).hidden_units == units
    refused: list[tuple[int, ...]] = [(), (0,), (8193,), (8,) * 17]
    for units in refused:
        with pytest.raises(kp.ConfigError, match=r"^hidden_units is .*; expected "):
            kp.preset("reference", hidden_units=units)


def assert_largest_batch(config: Config, stored: int) -> None:
    assert dataclasses.replace(config, batch_size=stored).batch_size == stored
    message = f"^batch_size {stored + 1} is larger than the {stored} transitions"
    with pytest.raises(kp.ConfigError, match=message):
        dataclasses.replace(config, batch_size=stored + 1)


def test_each_evaluation_adds_16_bytes_to_the_largest_checkpoint() -> None:
    # As above, with 4 evaluations in place of the last of 362 episodes.
    largest = kp.preset(
        "reference",
        hidden_units=(8192, 6000),
        replay_capacity=8_535_792,
        episodes=361,
        evaluate_every=90,
    )
    with pytest.raises(kp.ConfigError, match=r"make a checkpoint of .* the limit is 1 GiB"):
        dataclasses.replace(largest, evaluate_every=72)


@pytest.mark.parametrize("warmup", [0, 1, 41])
def test_batch_larger_than_the_buffer_at_the_first_update_is_refused(warmup: int) -> None:
    config = kp.preset("reference", warmup_episodes=warmup, max_episode_steps=5, batch_size=5)
    assert_largest_batch(config, 5 * (warmup + 1))


@pytest.mark.parametrize(
    ("preset", "changes"),
    [
        ("reference", {}),
        # One update after each step, from the first full batch: any batch that fits is possible.
        ("cartpole-original", {}),
        ("original", {"train_frequency": "step", "warmup_episodes": 0, "max_episode_steps": 5}),
        # A fallen pole ends an episode, so the number of stored transitions is not known.
        ("cartpole", {"warmup_episodes": 0, "max_episode_steps": 5}),
    ],
)
def test_batch_larger_than_the_buffer_is_refused(preset: str, changes: dict[str, Any]) -> None:
    config = kp.preset(preset, replay_capacity=50, batch_size=1, **changes)
    assert_largest_batch(config, 50)


@pytest.mark.parametrize(
    ("episodes", "warmup", "updates"), [(500, 41, 459), (42, 41, 1), (41, 41, 0), (3, 41, 0)]
)
def test_total_updates_counts_the_episodes_after_the_warmup(
    episodes: int, warmup: int, updates: int
) -> None:
    for per_episode in (1, 30):
        config = kp.preset(
            "reference",
            episodes=episodes,
            warmup_episodes=warmup,
            updates_per_episode=per_episode,
        )
        assert config.total_updates == updates * per_episode


def test_total_updates_without_warmup_counts_every_episode() -> None:
    config = kp.preset("reference", episodes=7, warmup_episodes=0, updates_per_episode=3)
    assert config.total_updates == 21


@pytest.mark.parametrize(
    ("preset", "changes", "message"),
    [
        ("cartpole", {"gravity": 1.0}, "gravity 1.0 belongs to Pendulum-v1; CartPole-v1 has no"),
        ("cartpole", {"torque_count": 5}, "torque_count 5 belongs to Pendulum-v1"),
        ("cartpole", {"stored_index": "truncated"}, "stored_index truncated belongs to Pendulum"),
        (
            "cartpole",
            {"train_frequency": "step"},
            "learning_rate_schedule cosine needs train_frequency",
        ),
        (
            "cartpole",
            {"environment": "Pendulum-v1", "gravity": None},
            "gravity is missing; Pendulum-v1 needs it",
        ),
        (
            "reference",
            {"train_frequency": "step"},
            "learning_rate_schedule cosine needs train_frequency",
        ),
        ("reference", {"gravity": None}, "gravity is missing; Pendulum-v1 needs it"),
        (
            "reference",
            {"learning_rate_min": 0.1},
            "learning_rate_min 0.1 is larger than learning_rate 0.001: make it smaller",
        ),
        (
            "reference",
            {"episodes": 9, "evaluate_every": 10},
            "evaluate_every 10 is larger than the run's 9 episodes: make it smaller, or 0",
        ),
        ("reference", {"snapshots": 1}, "snapshots is 1; expected 0 for none, or 2 to 100"),
        (
            "reference",
            {"episodes": 9, "snapshots": 11},
            "snapshots 11 is larger than the run's 9 episodes plus 1: make it smaller, or 0",
        ),
        (
            "reference",
            {"hidden_units": (8192, 3000), "snapshots": 20},
            "snapshots and hidden_units make a file of 1.0 GiB; the limit is 1 GiB",
        ),
        ("cartpole", {"keep_best": True}, "keep_best needs evaluate_every: .*--evaluate-every 50"),
        (
            "walkthrough",
            {"torque_count": 40},
            "stored_index truncated belongs to the walkthrough's 41 torques, not to .* 40",
        ),
    ],
)
def test_settings_that_exclude_each_other_are_refused(
    preset: str, changes: dict[str, Any], message: str
) -> None:
    with pytest.raises(kp.ConfigError, match=f"^{message}"):
        kp.preset(preset, **changes)
