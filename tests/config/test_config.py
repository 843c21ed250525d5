"""The Config: the range of each setting, and the settings that exclude each other."""

from __future__ import annotations

import dataclasses
import re
from typing import Any

import numpy as np
import pytest

import keras_pendulum as kp
from keras_pendulum.config.config import Config, Recording
from keras_pendulum.config.fields import Integer, Integers, Number, Only, Text, kind_of
from keras_pendulum.config.settings import read_settings

# The lowest and the highest value of each number.
LIMITS: dict[str, tuple[float, float]] = {
    "gravity": (0, 100),
    "episodes": (1, 1_000_000),
    "max_episode_steps": (1, 10_000),
    "seed": (0, 2**32 - 1),
    "hidden_units": (1, 8192),
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


def test_numbers_have_the_limits_of_this_file() -> None:
    kinds = {spec.name: kind_of(spec) for spec in dataclasses.fields(Config)}
    numbers = {name: kind for name, kind in kinds.items() if isinstance(kind, Number | Integers)}
    assert {name: (kind.low, kind.high) for name, kind in numbers.items()} == LIMITS


@pytest.mark.parametrize("kind", [Number(1, 10), Integer(1, 10)])
def test_limits_are_accepted_and_the_next_number_is_refused(kind: Number) -> None:
    assert (kind.validate("tau", 1), kind.validate("tau", 10)) == (1, 10)
    refused = [0, 11] if isinstance(kind, Integer) else np.nextafter([1, 10], [0, 11]).tolist()
    for value in refused:
        with pytest.raises(kp.ConfigError, match=r"^tau is .*; expected a .*number from 1 to 10"):
            kind.validate("tau", value)


def test_1_and_16_hidden_layers_of_1_to_8192_units_are_accepted() -> None:
    accepted: list[tuple[int, ...]] = [(1,), (8192,), (8,) * 16]
    for units in accepted:
        assert kp.preset("reference", hidden_units=units).hidden_units == units
    refused: list[tuple[int, ...]] = [(), (0,), (8193,), (8,) * 17]
    for units in refused:
        with pytest.raises(kp.ConfigError, match=r"^hidden_units is .*; expected "):
            kp.preset("reference", hidden_units=units)


@pytest.mark.parametrize("spec", dataclasses.fields(Config), ids=lambda spec: spec.name)
def test_value_that_no_setting_accepts_is_refused_with_its_setting(spec: Any) -> None:
    values: list[Any] = [object(), -5, float("nan"), (0,)]
    kind = kind_of(spec)
    if not isinstance(kind, Text) or kind.choices:
        values += ["", "nonsense"]
    for value in values:
        with pytest.raises(kp.ConfigError, match=f"^{spec.name} "):
            Config(**{spec.name: value})


# The largest checkpoints: with each of the changes, they are too large. For reference, 49 436 809
# weights in 4 copies, 33 bytes for each transition, 64 for each episode and 16 for each evaluation;
# for cartpole-original, 49 210 962 weights in 5 copies, and 41 bytes for each transition.
assert 16 * 49_436_809 + 33 * 8_535_792 + 64 * 362 == 2**30 - 2**20
assert 20 * 49_210_962 + 41 * 2_157_848 + 64 * 35 == 2**30 - 2**20
LARGEST: list[tuple[str, dict[str, int], list[dict[str, Any]]]] = [
    (
        "reference",
        {"replay_capacity": 8_535_792, "episodes": 362},
        [
            *({"replay_capacity": 8_535_793}, {"episodes": 363}, {"torque_count": 42}),
            *({"optimizer": "adamw"}, {"average_updates": 2}, {"hidden_units": (8192, 8192)}),
        ],
    ),
    # 4 evaluations in place of the last episode.
    (
        "reference",
        {"replay_capacity": 8_535_792, "episodes": 361, "evaluate_every": 90},
        [{"evaluate_every": 72}],
    ),
    (
        "cartpole-original",
        {"replay_capacity": 2_157_848, "episodes": 35},
        [{"replay_capacity": 2_157_849}],
    ),
]


@pytest.mark.parametrize(("preset", "settings", "larger"), LARGEST)
def test_largest_checkpoint_is_accepted_and_a_larger_one_is_refused(
    preset: str, settings: dict[str, Any], larger: list[dict[str, Any]]
) -> None:
    largest = kp.preset(preset, hidden_units=(8192, 6000), **settings)
    for changes in larger:
        with pytest.raises(kp.ConfigError, match=r"a checkpoint of 1\.\d GiB; the limit is 1 GiB"):
            dataclasses.replace(largest, **changes)


def assert_largest_batch(config: Config, stored: int) -> None:
    assert dataclasses.replace(config, batch_size=stored).batch_size == stored
    message = f"^batch_size {stored + 1} is larger than the {stored} transitions"
    with pytest.raises(kp.ConfigError, match=message):
        dataclasses.replace(config, batch_size=stored + 1)


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
        ("original", {"train_frequency": "step", "max_episode_steps": 5, "episodes": 1}),
        # A fallen pole ends an episode, so the number of stored transitions is not known.
        ("cartpole", {"warmup_episodes": 0, "max_episode_steps": 5}),
    ],
)
def test_batch_larger_than_the_buffer_is_refused(preset: str, changes: dict[str, Any]) -> None:
    config = kp.preset(preset, replay_capacity=50, batch_size=1, **changes)
    assert_largest_batch(config, 50)


@pytest.mark.parametrize(
    ("episodes", "warmup", "updates"),
    [(500, 41, 459), (42, 41, 1), (41, 41, 0), (3, 41, 0), (7, 0, 7)],
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


@pytest.mark.parametrize(
    ("preset", "changes", "message"),
    [
        ("cartpole", {"environment": "Pendulum-v1", "gravity": None}, "gravity is missing; "),
        (
            "reference",
            {"train_frequency": "step"},
            "learning_rate_schedule cosine needs train_frequency",
        ),
        ("reference", {"gravity": None}, "gravity is missing; environment Pendulum-v1 needs it"),
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


# A setting and a value of it, the setting that decides whether it has an effect, a value of that
# one with an effect and one without, and other settings that the latter needs.
CONDITIONS: list[tuple[str, Any, str, Any, Any, dict[str, Any]]] = [
    ("gravity", 1.0, "environment", "Pendulum-v1", "CartPole-v1", {}),
    ("torque_count", 5, "environment", "Pendulum-v1", "CartPole-v1", {"gravity": None}),
    ("stored_index", "truncated", "environment", "Pendulum-v1", "CartPole-v1", {"gravity": None}),
    ("epsilon_decay", 0.5, "epsilon_schedule", "episodes", "steps", {}),
    ("epsilon_decay_steps", 5.0, "epsilon_schedule", "steps", "episodes", {}),
    *(
        (name, 5, "train_frequency", "episode", "step", {"learning_rate_schedule": "constant"})
        for name in ("warmup_episodes", "updates_per_episode", "average_updates")
    ),
    ("weight_decay", 0.5, "optimizer", "adamw", "adam", {}),
    ("learning_rate_min", 1e-4, "learning_rate_schedule", "cosine", "constant", {}),
    ("double_q", True, "target_update", "soft", "none", {}),
    ("tau", 0.5, "target_update", "soft", "hard", {}),
    ("tau", 0.5, "target_update", "soft", "none", {}),
    ("target_period", 5, "target_update", "hard", "soft", {}),
    ("target_period", 5, "target_update", "hard", "none", {}),
    ("keep_best", True, "evaluate_every", 50, 0, {}),
]


def test_every_setting_with_a_condition_is_in_this_file() -> None:
    conditions = {spec.name: spec.metadata["only"] for spec in dataclasses.fields(Config)}
    assert {name for name, only in conditions.items() if only} == {row[0] for row in CONDITIONS}


@pytest.mark.parametrize(("name", "value", "other", "with_effect", "without", "more"), CONDITIONS)
def test_setting_without_an_effect_is_refused_reset_or_read(
    name: str, value: Any, other: str, with_effect: Any, without: Any, more: dict[str, Any]
) -> None:
    used = Config(**{other: with_effect, name: value})
    assert getattr(used, name) == value
    text = str(value).lower()
    remedy = "set gravity none" if name == "gravity" else "leave it out"
    shown = {"keep_best": "above 0", "double_q": "soft or hard"}.get(name, with_effect)
    message = (
        f"{name} {text} has no effect with {other} {without}: {remedy}, or set {other} {shown}"
    )
    unused = Config(**{"gravity": None if other == "environment" else 1.0, other: without, **more})
    for config, changes in (
        (unused, {name: value}),
        (used, {name: value, other: without, **more}),
    ):
        for change in (dataclasses.replace, Config.change):
            with pytest.raises(kp.ConfigError, match=f"^{re.escape(message)}$"):
                change(config, **changes)
    assert used.change(**{other: without, **more}) == unused
    assert read_settings({**vars(unused), name: value}) == unused


def test_setting_names_the_condition_after_its_decider_and_in_its_help() -> None:
    names = [spec.name for spec in dataclasses.fields(Config)]
    for spec in dataclasses.fields(Config):
        only: Only | None = spec.metadata["only"]
        if only:
            # So the decider is validated first, and its error is the one that is raised.
            assert names.index(only.name) < names.index(spec.name)
            assert f"; only with {only}" in spec.metadata["help"]


def test_wrong_value_of_the_decider_is_refused_before_the_settings_without_an_effect() -> None:
    for change in (dataclasses.replace, Config.change):
        with pytest.raises(kp.ConfigError, match=r"^target_update is 'sometimes'; expected one of"):
            change(kp.preset("cartpole-original"), target_update="sometimes")


def test_learning_has_every_setting_that_is_not_of_the_recording() -> None:
    assert [spec.name for spec in dataclasses.fields(Recording)] == [
        *("save_every", "evaluate_every", "keep_best", "snapshots")
    ]
    config = Config(seed=3, save_every=7, evaluate_every=5, keep_best=True, snapshots=2)
    assert Config(**config.learning()) == Config(seed=3)
    assert vars(config).keys() - config.learning().keys() == set(Recording.__dataclass_fields__)
    assert next(iter(vars(config))) == "preset"
