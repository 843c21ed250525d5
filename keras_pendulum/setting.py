"""A setting: a dataclass field that knows its meaning and which values it can take."""

from __future__ import annotations

import numbers
from collections.abc import Mapping, Sequence
from dataclasses import Field, field
from typing import Any

from keras_pendulum.errors import ConfigError


def setting(
    default: Any,
    meaning: str,
    *,
    low: float | None = None,
    high: float | None = None,
    choices: tuple[str, ...] | None = None,
) -> Any:
    """A field with a default, what it means, and its range or its choices."""
    return field(
        default=default,
        metadata={"meaning": meaning, "low": low, "high": high, "choices": choices},
    )


def checked(spec: Field[Any], value: Any) -> Any:
    """`value` as the field `spec` keeps it: 3 for a float becomes 3.0.

    Raises ConfigError for a value of another kind or outside the field's range.
    """
    name, rule = spec.name, spec.metadata
    kind, _, optional = str(spec.type).partition(" | ")
    if value is None and optional:
        return None
    if kind == "str":
        if not isinstance(value, str):
            raise ConfigError(f"{name} is {value!r}; expected a name")
        if rule["choices"] is not None and value not in rule["choices"]:
            raise ConfigError(f"{name} is {value!r}; expected one of {', '.join(rule['choices'])}")
        return value
    if kind == "tuple[int, ...]":
        if not isinstance(value, Sequence) or not 1 <= len(value) <= 16:
            raise ConfigError(f"{name} is {value!r}; expected 1 to 16 whole numbers")
        return tuple(_checked_number(name, int, number, rule) for number in value)
    return _checked_number(name, float if kind == "float" else int, value, rule)


def _checked_number(name: str, kind: type, value: Any, rule: Mapping[str, Any]) -> Any:
    wanted = numbers.Real if kind is float else numbers.Integral
    if isinstance(value, bool) or not isinstance(value, wanted):
        word = "a number" if kind is float else "a whole number"
        raise ConfigError(f"{name} is {value!r}; expected {word}")
    if not rule["low"] <= value <= rule["high"]:  # written so that NaN fails too
        raise ConfigError(
            f"{name} is {value}; expected a number from {rule['low']} to {rule['high']}"
        )
    return kind(value)
