"""Settings by their names: those that a user types, and those that a file records."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from keras_pendulum.config.config import Config, used
from keras_pendulum.config.fields import kind_of
from keras_pendulum.errors import ConfigError, did_you_mean

# Settings of version 0.1 that have another name now.
RENAMED = {
    "update_after": "train_frequency (episode or step)",
    "learning_starts": "warmup_episodes (learning_starts + 1)",
    "target_blend": "tau",
    "bootstrap": "double_q (true or false)",
    "episode_steps": "max_episode_steps",
    "remembered_action": "stored_index (exact or truncated)",
}


def parse_setting(name: str, text: str) -> Any:
    """Returns the value of `name=text`; the Config checks its range.

    Raises ConfigError for an unknown or renamed setting, and for a text of another kind.
    """
    require_known(name)
    kind = kind_of(Config.__dataclass_fields__[name])
    try:
        return kind.parse(text)
    except ValueError as error:
        raise ConfigError(f"{name} is {text!r}; expected {kind.expected}") from error


def read_settings(recorded: Mapping[str, Any]) -> Config:
    """Returns the settings that a checkpoint, a network or `config.json` records as JSON.

    A setting that is missing has its default. One that has no effect with the others gets its
    default or None: older versions record any value of it.

    Raises ConfigError for other JSON, for an unknown or renamed setting, and for settings that no
    run can have.
    """
    if not isinstance(recorded, Mapping):
        raise ConfigError(f"the recorded settings are {recorded!r}; expected a JSON object")
    for name in recorded:
        require_known(name)
    return Config(**used({**vars(Config()), **recorded}))


def require_known(name: str) -> None:
    """Raises ConfigError for a name that is no setting; for an old name it says the new one."""
    if name in RENAMED:
        raise ConfigError(f"the setting {name} is now {RENAMED[name]}")
    if name not in Config.__dataclass_fields__:
        raise ConfigError(
            f"unknown setting {name}{did_you_mean(name, Config.__dataclass_fields__)}"
        )
