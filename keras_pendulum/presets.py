"""Every number of a run, with its unit and source; the presets are values of it."""

from __future__ import annotations

import numbers
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

from keras_pendulum.environment import STEPS_PER_EPISODE
from keras_pendulum.errors import ConfigError


def _setting(
    default: Any,
    meaning: str,
    *,
    low: float | None = None,
    high: float | None = None,
    choices: tuple[str, ...] | None = None,
) -> Any:
    return field(
        default=default,
        metadata={"meaning": meaning, "low": low, "high": high, "choices": choices},
    )


@dataclass(frozen=True)
class Config:
    """The settings of one run. The defaults are the preset `reference`.

    Raises ConfigError, naming the field, for a value outside its range.
    """

    preset: str = _setting("reference", "name of the preset these settings started from")
    environment: str = _setting("Pendulum-v1", "Gymnasium's name", choices=("Pendulum-v1",))
    gravity: float = _setting(
        1.0, "gravity in m/s² (Gymnasium's own default is 10; the original uses 1)", low=0, high=100
    )
    episodes: int = _setting(500, "episodes (original: 500)", low=1, high=1_000_000)
    episode_steps: int = _setting(
        STEPS_PER_EPISODE,
        "steps of a training episode (original: 200); evaluation always makes 200",
        low=1,
        high=10_000,
    )
    seed: int = _setting(0, "seed of every random draw of the run", low=0, high=2**32 - 1)
    hidden_units: tuple[int, ...] = _setting(
        (512, 256, 128), "widths of the tanh layers, comma-separated (original)", low=1, high=8192
    )
    torque_count: int = _setting(
        41, "torques, evenly spaced from -2 to 2 N·m (original: linspace)", low=2, high=1001
    )
    replay_capacity: int = _setting(
        25_000, "transitions remembered (original: 8000)", low=1, high=10_000_000
    )
    batch_size: int = _setting(
        32, "transitions in an update, drawn without replacement (original: 32)", low=1, high=65_536
    )
    discount: float = _setting(0.9, "discount γ a step (original: 0.9)", low=0, high=1)
    reward_scale: float = _setting(
        1.0, "factor on the rewards that are learned from (original: 1)", low=1e-6, high=1e6
    )
    bootstrap: str = _setting(
        "max",
        "how what follows is valued: max, the target network's highest value (original), or "
        "double, its value of the online network's choice (van Hasselt et al. 2016)",
        choices=("max", "double"),
    )
    epsilon_start: float = _setting(
        0.9, "ε before the first decay: share of random torques (original: 0.9)", low=0, high=1
    )
    epsilon_decay: float = _setting(
        0.99, "factor on ε before each episode (original: 0.99)", low=0, high=1
    )
    epsilon_min: float = _setting(0.01, "ε never falls below this (original: 0.01)", low=0, high=1)
    learning_starts: int = _setting(
        40,
        "updates follow each episode with a higher number than this (original: 40)",
        low=0,
        high=1_000_000,
    )
    updates_per_episode: int = _setting(
        22,
        "gradient updates after an episode (original: 1, `update-starvation`)",
        low=1,
        high=10_000,
    )
    learning_rate: float = _setting(
        1e-3, "Adam's first step size (original: 1e-3)", low=1e-9, high=10
    )
    learning_rate_schedule: str = _setting(
        "cosine",
        "constant (original), or a cosine from the first step size to 0 at the last update",
        choices=("constant", "cosine"),
    )
    target_update: str = _setting(
        "soft",
        "how the target network follows: soft (Lillicrap et al. 2016), hard (Mnih et al. 2015), "
        "or none (original, `no-target-network`: the online network is its own target)",
        choices=("soft", "hard", "none"),
    )
    target_blend: float = _setting(
        0.1,
        "soft: share of the online weights blended in after each update (tried out; no original)",
        low=0,
        high=1,
    )
    target_period: int = _setting(
        200,
        "hard: updates from one copy to the next (a usual value; no original)",
        low=1,
        high=1_000_000,
    )
    remembered_action: str = _setting(
        "index",
        "what the replay buffer keeps: the index, or the index got back from the torque by "
        "truncation (walkthrough, `index-truncation`)",
        choices=("index", "truncated"),
    )
    save_every: int = _setting(
        10, "episodes from one checkpoint to the next (walkthrough: 10)", low=1, high=1_000_000
    )

    def __post_init__(self) -> None:
        for spec in fields(self):
            value = checked_setting(spec.name, getattr(self, spec.name))
            object.__setattr__(self, spec.name, value)
        stored = min(self.replay_capacity, (self.learning_starts + 2) * self.episode_steps)
        if self.batch_size > stored:
            raise ConfigError(
                f"batch_size {self.batch_size} is larger than the {stored} transitions that "
                "replay_capacity and learning_starts leave for the first batch"
            )
        if self.remembered_action == "truncated" and self.torque_count != 41:
            raise ConfigError(
                "remembered_action 'truncated' belongs to the walkthrough's 41 torques, "
                f"not to torque_count {self.torque_count}"
            )

    @property
    def total_updates(self) -> int:
        """Updates that the whole run makes."""
        return max(0, self.episodes - self.learning_starts - 1) * self.updates_per_episode


def checked_setting(name: str, value: Any) -> Any:
    """`value` as the field `name` of Config keeps it: 3 for a float becomes 3.0.

    Raises ConfigError for a value of another kind or outside the field's range.
    """
    spec = Config.__dataclass_fields__[name]
    rule = spec.metadata
    if spec.type == "str":
        if not isinstance(value, str):
            raise ConfigError(f"{name} is {value!r}; expected a name")
        if rule["choices"] is not None and value not in rule["choices"]:
            raise ConfigError(f"{name} is {value!r}; expected one of {', '.join(rule['choices'])}")
        return value
    if spec.type == "tuple[int, ...]":
        if not isinstance(value, Sequence) or not 1 <= len(value) <= 16:
            raise ConfigError(f"{name} is {value!r}; expected 1 to 16 whole numbers")
        return tuple(_checked_number(name, int, number, rule) for number in value)
    return _checked_number(name, float if spec.type == "float" else int, value, rule)


def _checked_number(name: str, kind: type, value: Any, rule: Any) -> Any:
    wanted = numbers.Real if kind is float else numbers.Integral
    if isinstance(value, bool) or not isinstance(value, wanted):
        word = "a number" if kind is float else "a whole number"
        raise ConfigError(f"{name} is {value!r}; expected {word}")
    number = kind(value)
    if not rule["low"] <= number <= rule["high"]:  # written so that NaN fails too
        raise ConfigError(
            f"{name} is {number}; expected a number from {rule['low']} to {rule['high']}"
        )
    return number


_REFERENCE = Config()
# The final listing of the inverted-pendulum page (July 2023), to the last printed line.
_ORIGINAL = replace(
    _REFERENCE,
    preset="original",
    replay_capacity=8000,
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
    replay_capacity=100_000,
    batch_size=64,
    discount=0.98,
    reward_scale=0.02,
    bootstrap="double",
    epsilon_decay=0.997,
    updates_per_episode=30,
)

PRESETS: dict[str, Config] = {
    config.preset: config for config in (_REFERENCE, _ORIGINAL, _WALKTHROUGH, _SWINGUP)
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
