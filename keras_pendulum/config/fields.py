"""The fields of the Config: what each setting means, and which values it accepts."""

from __future__ import annotations

import numbers
from collections.abc import Sequence
from dataclasses import Field, dataclass, field
from typing import Any, ClassVar

from keras_pendulum.errors import ConfigError


@dataclass(frozen=True)
class Number:
    """A floating-point number from `low` to `high`; with `optional`, None as well."""

    low: float
    high: float
    optional: bool = False

    expected: ClassVar[str] = "a number"
    _abstract: ClassVar[Any] = numbers.Real
    _type: ClassVar[Any] = float

    def parse(self, text: str) -> Any:
        """Returns the value that a user typed. Raises ValueError for other text."""
        return None if self.optional and text == "none" else self._type(text)

    def validate(self, name: str, value: Any) -> Any:
        """Returns `value` as the Config stores it: 3 becomes 3.0. Raises ConfigError."""
        if value is None and self.optional:
            return None
        if isinstance(value, bool) or not isinstance(value, self._abstract):
            raise ConfigError(f"{name} is {value!r}; expected {self.expected}")
        if not self.low <= value <= self.high:  # written so that NaN fails too
            raise ConfigError(
                f"{name} is {value}; expected {self.expected} from {self.low} to {self.high}"
            )
        return self._type(value)


@dataclass(frozen=True)
class Integer(Number):
    """A whole number from `low` to `high`."""

    expected: ClassVar[str] = "a whole number"
    _abstract: ClassVar[Any] = numbers.Integral
    _type: ClassVar[Any] = int


@dataclass(frozen=True)
class Integers:
    """A tuple of 1 to 16 whole numbers, each from `low` to `high`."""

    low: int
    high: int

    expected: ClassVar[str] = "whole numbers with commas, such as 64,64"

    def parse(self, text: str) -> Any:
        """Returns the numbers of "512,256,128". Raises ValueError for other text."""
        return tuple(int(part) for part in text.split(","))

    def validate(self, name: str, value: Any) -> Any:
        """Returns `value` as a tuple of int. Raises ConfigError."""
        if (
            isinstance(value, str | bytes)
            or not isinstance(value, Sequence)
            or not 1 <= len(value) <= 16
        ):
            raise ConfigError(f"{name} is {value!r}; expected 1 to 16 whole numbers")
        one = Integer(self.low, self.high)
        return tuple(one.validate(name, number) for number in value)


@dataclass(frozen=True)
class Text:
    """A text; one of `choices`, where there are any."""

    choices: tuple[str, ...] = ()

    expected: ClassVar[str] = "a name"

    def parse(self, text: str) -> Any:
        """Returns the text."""
        return text

    def validate(self, name: str, value: Any) -> Any:
        """Returns `value`. Raises ConfigError."""
        if not isinstance(value, str):
            raise ConfigError(f"{name} is {value!r}; expected a name")
        if self.choices and value not in self.choices:
            raise ConfigError(f"{name} is {value!r}; expected one of {', '.join(self.choices)}")
        return value


@dataclass(frozen=True)
class Switch:
    """A value that is true or false."""

    expected: ClassVar[str] = "true or false"

    def parse(self, text: str) -> Any:
        """Returns the value of "true" or "false". Raises ValueError for other text."""
        if text not in ("true", "false"):
            raise ValueError(text)
        return text == "true"

    def validate(self, name: str, value: Any) -> Any:
        """Returns `value`. Raises ConfigError."""
        if not isinstance(value, bool):
            raise ConfigError(f"{name} is {value!r}; expected true or false")
        return value


Kind = Number | Integers | Text | Switch


def setting(default: Any, help: str, kind: Kind) -> Any:
    """Returns a dataclass field with its default, its help text and the values it accepts."""
    return field(default=default, metadata={"help": help, "kind": kind})


def kind_of(spec: Field[Any]) -> Kind:
    """Returns the kind of values that a field of the Config accepts."""
    kind: Kind = spec.metadata["kind"]
    return kind


def format_value(value: Any) -> str:
    """Returns a setting's value as a user types it."""
    if value is None:
        return "none"
    if isinstance(value, bool):
        return str(value).lower()
    return ",".join(map(str, value)) if isinstance(value, tuple) else str(value)
