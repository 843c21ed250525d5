"""Command-line flags for the settings of the Config."""

from __future__ import annotations

import argparse
from dataclasses import fields
from typing import Any

from keras_pendulum.cli import OneLineParser
from keras_pendulum.completion import complete_with, names
from keras_pendulum.config.config import Config, Recording
from keras_pendulum.config.fields import Integers, Switch, Text, format_value, kind_of
from keras_pendulum.config.presets import PRESETS
from keras_pendulum.config.settings import RENAMED, parse_setting

# The settings that people change first. `--help` shows these and those of Recording, `--help-all`
# shows all.
_FIRST = (
    *("gravity", "episodes", "seed", "hidden_units", "replay_capacity", "batch_size", "discount"),
    *("epsilon_decay", "updates_per_episode", "learning_rate"),
)


def add_config_flags(parser: OneLineParser) -> None:
    """Adds one flag for each setting but `preset`; a flag that is not typed stays unset.

    `--keep-best` and other switches need no value: alone they are true.
    """
    first = parser.add_argument_group(
        "settings that people change first (each preset has its own defaults)"
    )
    during = parser.add_argument_group("checkpoints, evaluations and snapshots during the run")
    others = parser.add_argument_group("other settings")
    groups = dict.fromkeys(_FIRST, first)
    groups |= {spec.name: during for spec in fields(Recording)}
    for spec in fields(Config):
        if spec.name != "preset":
            kind = kind_of(spec)
            options: dict[str, Any] = {"metavar": "N,N,…" if isinstance(kind, Integers) else "N"}
            if isinstance(kind, Text) and kind.choices:
                options = {"choices": kind.choices}
            elif isinstance(kind, Switch):  # without a value it is true
                options = {"nargs": "?", "const": "true", "metavar": "{true,false}"}
            flag = groups.get(spec.name, others).add_argument(
                _flag(spec.name),
                dest=spec.name,
                default=argparse.SUPPRESS,
                help=f"{spec.metadata['help']} [{_defaults(spec.name)}]".replace("%", "%%"),
                **options,
            )
            if isinstance(kind, Switch):
                complete_with(flag, names(("true", "false")))
            if spec.name not in groups:
                parser.hide(flag)
    for name in RENAMED:
        parser.add_argument(
            _flag(name), dest=name, default=argparse.SUPPRESS, help=argparse.SUPPRESS
        )


def settings_from_args(arguments: argparse.Namespace) -> dict[str, Any]:
    """Returns the settings that the user typed, without the preset.

    Raises ConfigError for the old name of a setting, and for a text of another kind.
    """
    names = {*Config.__dataclass_fields__, *RENAMED} - {"preset"}
    typed = vars(arguments).items()
    return {name: parse_setting(name, text) for name, text in typed if name in names}


def _flag(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def _defaults(name: str) -> str:
    """Returns the setting's default in `reference`, and in the presets that repeat an original."""
    shown = ("reference", "original", "cartpole-original")
    values = {preset: format_value(getattr(PRESETS[preset], name)) for preset in shown}
    return ", ".join(
        f"{preset}: {value}"
        for preset, value in values.items()
        if preset == "reference" or value != values["reference"]
    )
