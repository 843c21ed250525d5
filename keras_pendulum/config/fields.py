"""The fields of the Config: what each setting means, and which values it accepts."""

from __future__ import annotations

import numbers
from collections.abc import Collection, Mapping, Sequence
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


SEED = Integer(0, 2**32 - 1)  # those of an environment's reset


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
        if not isinstance(value, list | tuple) or not 1 <= len(value) <= 16:
            raise ConfigError(f"{name} is {value!r}; expected 1 to 16 whole numbers")
        one = Integer(self.low, self.high)
        return tuple(one.validate(name, number) for number in value)


@dataclass(frozen=True)
class Text:
    """A text; one of `choices`, where there are any."""

    choices: Collection[str] = ()

    @property
    def expected(self) -> str:
        """The values that are accepted, in words."""
        return f"one of {', '.join(self.choices)}" if self.choices else "a name"

    def parse(self, text: str) -> Any:
        """Returns the text."""
        return text

    def validate(self, name: str, value: Any) -> Any:
        """Returns `value`. Raises ConfigError."""
        if not isinstance(value, str) or (self.choices and value not in self.choices):
            raise ConfigError(f"{name} is {value!r}; expected {self.expected}")
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


@dataclass(frozen=True)
class Only:
    """The values of another setting with which a setting has an effect."""

    name: str  # of the other setting
    values: tuple[str, ...]  # every value but 0 where there are none
    unused: Any  # the value of a setting without an effect

    def holds(self, settings: Mapping[str, Any]) -> bool:
        """Returns whether the setting has an effect with these settings."""
        value = settings[self.name]
        return value in self.values if self.values else bool(value)

    def check(self, name: str, value: Any, settings: Mapping[str, Any]) -> None:
        """Raises ConfigError for a value of the setting `name` that is not used, or missing."""
        other = settings[self.name]
        if self.holds(settings):
            if value is None and self.unused is None:
                raise ConfigError(f"{name} is missing; {self.name} {other} needs it")
        elif value != self.unused:
            change = f"set {name} none" if self.unused is None else "leave it out"
            raise ConfigError(
                f"{name} {format_value(value)} has no effect with {self.name} "
                f"{format_value(other)}: {change}, or set {self}"
            )

    def __str__(self) -> str:
        return f"{self.name} {' or '.join(self.values) or 'above 0'}"


def setting(default: Any, help: str, kind: Kind, only: Sequence[str] = ()) -> Any:
    """Returns a dataclass field of the Config.

    Args:
        default: its value in `reference`.
        help: what it means.
        kind: the values that it accepts.
        only: the name of another setting, and the values of that one with which this one has an
            effect; the name alone stands for every value but 0. Without an effect, an optional
            setting is None, and any other has its default.
    """
    condition = None
    if only:
        unused = None if isinstance(kind, Number) and kind.optional else default
        condition = Only(only[0], tuple(only[1:]), unused)
        help += f"; only with {condition}{', else none' if unused is None else ''}"
    return field(default=default, metadata={"help": help, "kind": kind, "only": condition})


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
