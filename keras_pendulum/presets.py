"""The presets: values of Config, each a change to another one."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

from keras_pendulum.config import Config
from keras_pendulum.errors import ConfigError

_REFERENCE = Config()
# The final listing of the inverted-pendulum page (July 2023), to the last printed line.
_ORIGINAL = replace(
    _REFERENCE,
    preset="original",
    replay_capacity=8000,
    update_after="episode",
    updates_per_episode=1,
    learning_rate_schedule="constant",
    target_update="none",
)
# The step-by-step listing on the same page, its runnable block.
_WALKTHROUGH = replace(
    _ORIGINAL,
    preset="walkthrough",
    episodes=400,
    hidden_units=(128, 64, 32),
    replay_capacity=4000,
    batch_size=64,
    remembered_action="truncated",
)

# The standard, harder task: g = 10, where the torque cannot lift the pendulum in one go.
_SWINGUP = replace(
    _REFERENCE,
    preset="swingup",
    gravity=10.0,
    episodes=1700,
    episode_steps=60,
    batch_size=64,
    discount=0.98,
    reward_scale=0.02,
    epsilon_decay=0.997,
    update_after="episode",
)

# The agent of the two PyTorch notebooks, with their numbers.
_CARTPOLE_ORIGINAL = Config(
    preset="cartpole-original",
    environment="CartPole-v1",
    gravity=None,
    episodes=600,
    episode_steps=500,
    hidden_units=(128, 128),
    activation="relu",
    initial_weights="fan-in",
    replay_capacity=10_000,
    batch_size=128,
    discount=0.99,
    loss="huber",
    epsilon_schedule="steps",
    epsilon_start=0.9,
    epsilon_min=0.05,
    update_after="step",
    optimizer="adamw",
    optimizer_epsilon=1e-8,
    weight_decay=0.01,
    gradient_clip=100.0,
    learning_rate=1e-4,
    learning_rate_schedule="constant",
    target_blend=0.005,
)

# The same network on the same task, tuned to hold the pole for all 500 steps.
_CARTPOLE = replace(
    _CARTPOLE_ORIGINAL,
    preset="cartpole",
    episodes=800,
    # The whole run: once the falls of its beginning are forgotten, values run away.
    replay_capacity=400_000,
    reward_scale=0.01,
    bootstrap="double",
    epsilon_schedule="episodes",
    epsilon_decay=0.98,
    update_after="episode",
    updates_per_episode=120,
    weight_decay=0.05,
    learning_rate=1e-3,
    learning_rate_schedule="cosine",
    target_blend=0.02,
)

PRESETS: dict[str, Config] = {
    config.preset: config
    for config in (
        _REFERENCE,
        _ORIGINAL,
        _WALKTHROUGH,
        _SWINGUP,
        _CARTPOLE_ORIGINAL,
        _CARTPOLE,
    )
}


def preset(name: str = "reference", **changes: Any) -> Config:
    """The preset `name`, with single settings changed.

    Raises ConfigError for an unknown preset, an unknown setting, or a value out of range.
    """
    if name not in PRESETS:
        raise ConfigError(f"unknown preset {name!r}; expected one of {', '.join(PRESETS)}")
    unknown = changes.keys() - {spec.name for spec in fields(Config)}
    if unknown:
        raise ConfigError(f"unknown setting {', '.join(sorted(unknown))}")
    return replace(PRESETS[name], **changes)
