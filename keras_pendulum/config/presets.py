"""The presets: Configs with names, each a change to another one."""

from __future__ import annotations

from typing import Any

from keras_pendulum.config.config import Config
from keras_pendulum.config.settings import require_known
from keras_pendulum.errors import ConfigError, did_you_mean

PRESETS: dict[str, Config] = {}
DESCRIPTIONS: dict[str, str] = {}  # one line for each preset


def _define(name: str, description: str, base: Config, **changes: Any) -> Config:
    """Lists a preset that is `base` with some settings changed; returns it."""
    DESCRIPTIONS[name] = description
    PRESETS[name] = base.change(preset=name, **changes)
    return PRESETS[name]


_REFERENCE = _define("reference", "the original without defects (default)", Config())
# The final listing of the inverted-pendulum page (July 2023).
_ORIGINAL = _define(
    "original",
    "the final listing, with its defects",
    _REFERENCE,
    max_episode_steps=200,
    replay_capacity=8000,
    updates_per_episode=1,
    learning_rate_schedule="constant",
    target_update="none",
)
# The runnable block of the step-by-step listing on the same page.
_define(
    "walkthrough",
    "the step-by-step listing, with defects",
    _ORIGINAL,
    episodes=400,
    hidden_units=(128, 64, 32),
    replay_capacity=4000,
    batch_size=64,
    stored_index="truncated",
)
_define(
    "swingup",
    "the same agent on the standard task",
    _REFERENCE,
    gravity=10.0,  # the torque cannot lift the pendulum in one swing
    episodes=3400,
    # Most regret arises in the first 20 steps; 30 are too short (docs/last_regret.md).
    max_episode_steps=40,
    initial_weights="spread",
    batch_size=64,
    discount=0.985,
    reward_scale=0.02,
    epsilon_decay=0.997,
    # At the end, the buffer then holds only what the greedy policy meets.
    epsilon_min=0.0,
    updates_per_episode=14,
    # A policy of one update is noisy; the average needs a learning rate that does not fall to 0.
    learning_rate_min=5e-5,
    average_updates=1500,
)
_CARTPOLE_ORIGINAL = _define(
    "cartpole-original",
    "the agent of two PyTorch notebooks",
    _REFERENCE,
    environment="CartPole-v1",
    episodes=600,
    max_episode_steps=500,
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
    train_frequency="step",
    optimizer="adamw",
    optimizer_epsilon=1e-8,
    weight_decay=0.01,
    gradient_clip=100.0,
    learning_rate=1e-4,
    learning_rate_schedule="constant",
    tau=0.005,
)
_define(
    "cartpole",
    "this agent, tuned for all 500 steps",
    _CARTPOLE_ORIGINAL,
    reward_scale=0.01,
    # Random actions bring the cart near the ends of its track, also at the end of the run.
    epsilon_min=0.2,
    train_frequency="episode",
    learning_rate=1e-3,
    learning_rate_schedule="cosine",
    # As in swingup: an average of weights that still move a little.
    learning_rate_min=1e-4,
    tau=0.03,
    average_updates=1500,
)


def preset(name: str = "reference", **changes: Any) -> Config:
    """Returns the preset `name` with some settings changed, as `Config.change` does.

    Raises ConfigError for an unknown preset or setting, for a value out of range, and for another
    environment without its gravity.

    >>> kp.preset("original", seed=3).updates_per_episode
    1
    """
    if name not in PRESETS:
        raise ConfigError(
            f"unknown preset {name!r}; expected one of {', '.join(PRESETS)}"
            f"{did_you_mean(str(name), PRESETS)}"
        )
    own, environment = PRESETS[name].environment, changes.get("environment")
    suitable = [each.preset for each in PRESETS.values() if each.environment == environment]
    if suitable and environment != own and "gravity" not in changes:
        raise ConfigError(
            f"the preset {name} belongs to {own}: for {environment}, take one of the presets "
            f"{', '.join(suitable)} (--preset NAME)"
        )
    for setting in changes:
        require_known(setting)
    return PRESETS[name].change(**changes)
