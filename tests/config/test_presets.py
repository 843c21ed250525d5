"""The presets: the numbers of the originals, and how a preset is changed.

The numbers of the others are in docs/presets.md, which tests/project/test_figures.py compares.
"""

from __future__ import annotations

import pytest

import keras_pendulum as kp
from keras_pendulum.config.config import Config
from keras_pendulum.config.presets import DESCRIPTIONS, PRESETS


def test_original_has_the_numbers_of_the_final_listing() -> None:
    config = kp.preset("original")
    assert config.hidden_units == (512, 256, 128)
    assert (config.gravity, config.episodes, config.torque_count) == (1.0, 500, 41)
    assert (config.replay_capacity, config.batch_size, config.discount) == (8000, 32, 0.9)
    assert (config.epsilon_start, config.epsilon_decay, config.epsilon_min) == (0.9, 0.99, 0.01)
    assert (config.train_frequency, config.warmup_episodes) == ("episode", 41)
    assert (config.updates_per_episode, config.total_updates) == (1, 459)
    assert (config.learning_rate, config.learning_rate_schedule) == (1e-3, "constant")
    assert (config.optimizer, config.optimizer_epsilon, config.loss) == ("adam", 1e-7, "squared")
    assert (config.target_update, config.stored_index) == ("none", "exact")


def test_walkthrough_has_the_numbers_of_the_step_by_step_listing() -> None:
    config = kp.preset("walkthrough")
    assert config.hidden_units == (128, 64, 32)
    assert (config.replay_capacity, config.batch_size, config.episodes) == (4000, 64, 400)
    assert (config.warmup_episodes, config.updates_per_episode) == (41, 1)
    assert (config.target_update, config.stored_index) == ("none", "truncated")


def test_reference_is_the_default_and_has_no_defect() -> None:
    assert kp.preset() == kp.preset("reference") == Config()
    assert Config().target_update != "none"
    assert Config().stored_index == "exact"
    assert Config().total_updates == 40 * 459
    assert Config().train_frequency == "episode"


def test_cartpole_original_has_the_numbers_of_the_notebooks() -> None:
    config = kp.preset("cartpole-original")
    assert (config.environment, config.gravity) == ("CartPole-v1", None)
    assert (config.episodes, config.max_episode_steps) == (600, 500)
    assert (config.hidden_units, config.activation) == ((128, 128), "relu")
    assert (config.replay_capacity, config.batch_size, config.discount) == (10_000, 128, 0.99)
    assert (config.optimizer, config.learning_rate, config.weight_decay) == ("adamw", 1e-4, 0.01)
    assert (config.loss, config.gradient_clip, config.double_q) == ("huber", 100, False)
    assert (config.epsilon_schedule, config.epsilon_decay_steps) == ("steps", 1000)
    assert (config.epsilon_start, config.epsilon_min) == (0.9, 0.05)
    assert (config.train_frequency, config.learning_rate_schedule) == ("step", "constant")
    assert (config.target_update, config.tau) == ("soft", 0.005)


def test_presets_are_listed_under_their_own_names() -> None:
    assert list(PRESETS) == [
        *("reference", "original", "walkthrough", "swingup"),
        *("cartpole-original", "cartpole"),
    ]
    assert all(config.preset == name for name, config in PRESETS.items())
    assert list(DESCRIPTIONS) == list(PRESETS)


@pytest.mark.parametrize("name", ["nonsense", "", "Reference"])
def test_unknown_preset_is_refused_with_the_names_of_the_presets(name: str) -> None:
    with pytest.raises(kp.ConfigError, match=f"^unknown preset '{name}'.*reference, original"):
        kp.preset(name)


@pytest.mark.parametrize(
    ("name", "similar"),
    [("refrence", "reference"), ("CARTPOLE", "cartpole"), ("swing-up", "swingup")],
)
def test_mistyped_preset_is_refused_with_the_similar_one(name: str, similar: str) -> None:
    with pytest.raises(kp.ConfigError, match=rf"cartpole; did you mean {similar}\?$"):
        kp.preset(name)


@pytest.mark.parametrize(
    ("name", "environment", "suitable"),
    [
        ("reference", "CartPole-v1", "cartpole-original, cartpole"),
        ("cartpole", "Pendulum-v1", "reference, original, walkthrough, swingup"),
    ],
)
def test_other_environment_without_its_gravity_is_refused_with_its_presets(
    name: str, environment: str, suitable: str
) -> None:
    with pytest.raises(kp.ConfigError, match=rf"one of the presets {suitable} \(--preset NAME\)$"):
        kp.preset(name, environment=environment)
    first = suitable.split(", ")[0]
    assert kp.preset(first, environment=environment) == kp.preset(first)
    gravity = 1.0 if environment == "Pendulum-v1" else None
    assert kp.preset(name, environment=environment, gravity=gravity).environment == environment


def test_environment_that_does_not_exist_is_refused_with_those_that_do() -> None:
    with pytest.raises(kp.ConfigError, match=r"^environment is 'A'; expected .* CartPole-v1$"):
        kp.preset("reference", environment="A")


def test_preset_is_changed_where_its_settings_lose_their_effect() -> None:
    config = kp.preset("cartpole-original", target_update="hard")
    assert (kp.preset("cartpole-original").tau, config.tau) == (0.005, Config.tau)
    with pytest.raises(kp.ConfigError, match=r"^tau 0.5 has no effect with target_update hard: "):
        kp.preset("cartpole-original", target_update="hard", tau=0.5)
