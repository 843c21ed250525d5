"""Command-line flags for the settings of the Config."""

from __future__ import annotations

import argparse
from dataclasses import fields
from typing import Any

from keras_pendulum.cli import OneLineParser
from keras_pendulum.completion import complete_with, names
from keras_pendulum.config.config import Config
from keras_pendulum.config.fields import Switch, Text, format_value, kind_of
from keras_pendulum.config.presets import PRESETS
from keras_pendulum.config.settings import RENAMED, parse_setting
from keras_pendulum.errors import ConfigError

# The settings that people change first. `--help` shows these, `--help-all` shows all.
_FIRST = (
    *("gravity", "episodes", "seed", "hidden_units", "replay_capacity", "batch_size", "discount"),
    *("epsilon_decay", "updates_per_episode", "learning_rate"),
)
# These change nothing in what is learned, and `--help` shows them too.
_DURING_THE_RUN = ("evaluate_every", "keep_best", "snapshots")


def add_config_flags(parser: OneLineParser) -> None:
    """Adds one flag for each setting but `preset`; a flag that is not typed stays unset.

    `--keep-best` and other switches need no value: alone they are true.
    """
    first = parser.add_argument_group(
        "settings that people change first (each preset has its own defaults)"
    )
    during = parser.add_argument_group("evaluations and snapshots during the run")
    others = parser.add_argument_group("other settings")
    groups = dict.fromkeys(_FIRST, first) | dict.fromkeys(_DURING_THE_RUN, during)
    for spec in fields(Config):
        if spec.name != "preset":
            kind = kind_of(spec)
            choices = kind.choices if isinstance(kind, Text) else None
            flag = groups.get(spec.name, others).add_argument(
                _flag(spec.name),
                dest=spec.name,
                action=_Setting,
                nargs="?" if isinstance(kind, Switch) else None,
                const="true",  # of a switch without a value
                choices=choices or None,
                default=argparse.SUPPRESS,
                metavar=None if choices else "{true,false}" if isinstance(kind, Switch) else "N",
                help=f"{spec.metadata['help']} [{_defaults(spec.name)}]".replace("%", "%%"),
            )
            if isinstance(kind, Switch):
                complete_with(flag, names(("true", "false")))
            if spec.name not in groups:
                parser.hide(flag)
    for name in RENAMED:
        parser.add_argument(_flag(name), dest=name, action=_Setting, help=argparse.SUPPRESS)


def settings_from_args(arguments: argparse.Namespace) -> dict[str, Any]:
    """Returns the settings that the user typed, without the preset."""
    names = {spec.name for spec in fields(Config)} - {"preset"}
    return {name: value for name, value in vars(arguments).items() if name in names}


class _Setting(argparse.Action):
    """An argparse action that parses a setting; for an old name, the error says the new one."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: Any,
        option_string: str | None = None,
    ) -> None:
        try:
            setattr(namespace, self.dest, parse_setting(self.dest, values))
        except ConfigError as error:
            parser.error(str(error))


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
