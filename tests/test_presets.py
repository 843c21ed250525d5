from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

import keras_pendulum as kp
from keras_pendulum.config import Config
from keras_pendulum.presets import PRESETS

INF, NAN = float("inf"), float("nan")


def test_the_original_has_the_final_listings_numbers() -> None:
    config = kp.preset("original")
    assert config.hidden_units == (512, 256, 128)
    assert (config.gravity, config.episodes, config.torque_count) == (1.0, 500, 41)
    assert (config.replay_capacity, config.batch_size, config.discount) == (8000, 32, 0.9)
    assert (config.epsilon_start, config.epsilon_decay, config.epsilon_min) == (0.9, 0.99, 0.01)
    assert (config.learning_starts, config.updates_per_episode) == (40, 1)
    assert (config.learning_rate, config.learning_rate_schedule) == (1e-3, "constant")
    assert (config.target_update, config.remembered_action) == ("none", "index")
    assert config.total_updates == 459


def test_the_walkthrough_has_the_step_by_step_numbers() -> None:
    config = kp.preset("walkthrough")
    assert config.hidden_units == (128, 64, 32)
    assert (config.replay_capacity, config.batch_size, config.episodes) == (4000, 64, 400)
    assert (config.learning_starts, config.updates_per_episode) == (40, 1)
    assert (config.target_update, config.remembered_action) == ("none", "truncated")


def test_the_default_is_the_reference() -> None:
    assert kp.preset() == kp.preset("reference") == Config()
    assert Config().target_update != "none"
    assert Config().remembered_action == "index"


def test_every_setting_says_what_it_means() -> None:
    for spec in dataclasses.fields(Config):
        assert len(spec.metadata["meaning"]) > 10, spec.name


def test_settings_can_be_changed_one_by_one() -> None:
    config = kp.preset("reference", seed=3, episodes=200)
    assert (config.seed, config.episodes, config.preset) == (3, 200, "reference")


@pytest.mark.parametrize("name", ["nonsense", "", "Reference"])
def test_an_unknown_preset_is_told_with_the_known_ones(name: str) -> None:
    with pytest.raises(kp.ConfigError, match=f"unknown preset '{name}'.*reference, original"):
        kp.preset(name)


def test_numbers_of_numpy_and_lists_are_as_good() -> None:
    changed = kp.preset(
        "reference", episodes=np.int64(9), gravity=np.float32(2), hidden_units=[8, np.int32(4)]
    )
    plain = kp.preset("reference", episodes=9, gravity=2, hidden_units=(8, 4))
    assert changed == plain
    assert (type(changed.episodes), type(changed.gravity)) == (int, float)


def test_an_unknown_setting_is_named() -> None:
    with pytest.raises(kp.ConfigError, match="unknown setting learning_speed"):
        kp.preset("reference", learning_speed=1)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *[("gravity", value) for value in (-1.0, NAN, INF, 101.0)],
        *[("episodes", value) for value in (0, -5, 10**9)],
        *[("seed", value) for value in (-1, 2**32)],
        *[("hidden_units", value) for value in ((), (0,), (10**6,), (8,) * 17)],
        *[("torque_count", value) for value in (0, 1, 10**6)],
        *[("replay_capacity", value) for value in (0, -1, 10**12)],
        *[("batch_size", value) for value in (0, 10**9)],
        *[("discount", value) for value in (-0.1, 1.1, NAN)],
        *[("epsilon_start", value) for value in (-0.1, 1.1, NAN)],
        *[("learning_rate", value) for value in (0.0, -1e-3, NAN, INF, 1e9)],
        *[("updates_per_episode", value) for value in (0, -1)],
        *[("target_blend", value) for value in (-0.1, 1.5, NAN)],
        *[("target_update", value) for value in ("", "sometimes")],
        *[("learning_rate_schedule", value) for value in ("linear",)],
        *[("environment", value) for value in ("Acrobot-v1", "Nonsense-v0")],
        *[("save_every", value) for value in (0, -1)],
        *[("episodes", value) for value in (1.5, True, "12", None, (5,))],
        *[("gravity", value) for value in (True, "1", None, (0.5,))],
        *[("hidden_units", value) for value in (8, "8", None, (8.5,), (8, "8"))],
        *[("target_update", value) for value in (5, None, ("soft",))],
    ],
)
def test_a_value_that_no_run_can_have_is_named(name: str, value: Any) -> None:
    with pytest.raises(kp.ConfigError, match=f"^{name} "):
        kp.preset("reference", **{name: value})


def test_a_checkpoint_that_could_not_be_read_is_refused_before_the_run() -> None:
    with pytest.raises(kp.ConfigError, match=r"make a checkpoint of 1\.0 GiB, where less than 1"):
        kp.preset("reference", hidden_units=(8192, 8192))
    with pytest.raises(kp.ConfigError, match=r"make a checkpoint of 1\.2 GiB"):
        kp.preset("cartpole-original", hidden_units=(8000, 7000), replay_capacity=4_000_000)
    assert kp.preset("reference", hidden_units=(8192, 6000)).hidden_units == (8192, 6000)


def test_a_number_beyond_all_floats_is_refused_too() -> None:
    with pytest.raises(kp.ConfigError, match=r"^learning_rate is 1000"):
        kp.preset("reference", learning_rate=10**400)


def test_a_batch_larger_than_the_buffer_is_refused() -> None:
    with pytest.raises(kp.ConfigError, match="batch_size 64 is larger than the 50 transitions"):
        kp.preset("reference", batch_size=64, replay_capacity=50)


@pytest.mark.parametrize(("update_after", "stored"), [("episode", 400), ("reset", 200)])
def test_a_batch_larger_than_what_is_stored_at_the_first_update_is_refused(
    update_after: str, stored: int
) -> None:
    small = {"episodes": 2, "hidden_units": (8,), "learning_starts": 0}
    fits = kp.preset("reference", update_after=update_after, batch_size=stored, **small)
    assert [record.updates for record in kp.train_dqn(fits).history] == [0, 30]
    with pytest.raises(kp.ConfigError, match=f"{stored + 1} is larger than the {stored} transi"):
        dataclasses.replace(fits, batch_size=stored + 1)


def test_the_swingup_is_the_reference_on_the_standard_task() -> None:
    config = kp.preset("swingup")
    assert (config.gravity, config.bootstrap, config.discount) == (10.0, "max", 0.98)
    assert (config.hidden_units, config.torque_count) == ((512, 256, 128), 41)


def test_presets_are_listed_by_their_own_name() -> None:
    assert all(config.preset == name for name, config in PRESETS.items())


def test_cartpole_original_has_the_notebooks_numbers() -> None:
    config = kp.preset("cartpole-original")
    assert (config.environment, config.episodes, config.episode_steps) == ("CartPole-v1", 600, 500)
    assert (config.hidden_units, config.activation) == ((128, 128), "relu")
    assert (config.replay_capacity, config.batch_size, config.discount) == (10_000, 128, 0.99)
    assert (config.optimizer, config.learning_rate, config.weight_decay) == ("adamw", 1e-4, 0.01)
    assert (config.loss, config.gradient_clip, config.bootstrap) == ("huber", 100, "max")
    assert (config.epsilon_schedule, config.epsilon_decay_steps) == ("steps", 1000)
    assert (config.epsilon_start, config.epsilon_min) == (0.9, 0.05)
    assert (config.update_after, config.learning_rate_schedule) == ("step", "constant")
    assert (config.target_update, config.target_blend) == ("soft", 0.005)


def test_cartpole_keeps_the_notebooks_network_and_optimizer() -> None:
    ours, theirs = kp.preset("cartpole"), kp.preset("cartpole-original")
    for name in ("environment", "hidden_units", "activation", "loss", "optimizer", "discount"):
        assert getattr(ours, name) == getattr(theirs, name), name


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"gravity": 1.0}, "gravity 1.0 belongs to Pendulum-v1; CartPole-v1 has no torque"),
        ({"torque_count": 5}, "torque_count 5 belongs to Pendulum-v1"),
        ({"remembered_action": "truncated"}, "remembered_action truncated belongs to Pendulum-v1"),
        ({"learning_rate_schedule": "cosine"}, "cosine needs update_after episode"),
        ({"environment": "Pendulum-v1"}, "gravity is missing; Pendulum-v1 needs it"),
    ],
)
def test_settings_that_do_not_go_together_are_named(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(kp.ConfigError, match=message):
        kp.preset("cartpole-original", **changes)
