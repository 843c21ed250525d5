"""The kinds of settings: the text that each parses, and the values that each accepts."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import keras_pendulum as kp
from keras_pendulum.config.fields import (
    Integer,
    Integers,
    Kind,
    Number,
    Switch,
    Text,
    format_value,
)

NUMBER = Number(0.5, 2)
OPTIONAL = Number(0.5, 2, optional=True)
INTEGER = Integer(1, 9)
INTEGERS = Integers(1, 9)
CHOICE = Text(("tanh", "relu"))


@pytest.mark.parametrize(
    ("kind", "text", "value"),
    [
        (NUMBER, "0.75", 0.75),
        (NUMBER, "5e-1", 0.5),
        (NUMBER, "1", 1.0),
        (OPTIONAL, "1", 1.0),
        (OPTIONAL, "none", None),
        (INTEGER, "7", 7),
        (INTEGERS, "7", (7,)),
        (INTEGERS, "5,1,2", (5, 1, 2)),
        (Text(), "any name", "any name"),
        (CHOICE, "relu", "relu"),
        (Switch(), "true", True),
        (Switch(), "false", False),
    ],
)
def test_parse_returns_the_value_of_a_text(kind: Kind, text: str, value: object) -> None:
    parsed = kind.parse(text)
    assert (parsed, type(parsed)) == (value, type(value))


@pytest.mark.parametrize(
    ("kind", "text"),
    [
        *[(NUMBER, text) for text in ("", "none", "1,5", "one")],
        *[(OPTIONAL, text) for text in ("", "None", "null")],
        *[(INTEGER, text) for text in ("", "none", "1.5", "1e3", "true")],
        *[(INTEGERS, text) for text in ("", "none", "5,", "5;1", "5,1.5", "(5, 1)")],
        *[(Switch(), text) for text in ("", "none", "True", "1", "yes")],
    ],
)
def test_text_of_another_kind_is_refused(kind: Kind, text: str) -> None:
    with pytest.raises(ValueError):
        kind.parse(text)


@pytest.mark.parametrize(
    ("kind", "value", "stored"),
    [
        (NUMBER, 0.5, 0.5),  # the lowest
        (NUMBER, 2, 2.0),  # the highest
        (NUMBER, np.float32(1.5), 1.5),
        (NUMBER, np.int64(1), 1.0),
        (OPTIONAL, None, None),
        (OPTIONAL, 2, 2.0),
        (INTEGER, 1, 1),
        (INTEGER, 9, 9),
        (INTEGER, np.int64(5), 5),
        (INTEGERS, (1, 9), (1, 9)),
        (INTEGERS, [np.int32(5)], (5,)),
        (INTEGERS, (3,) * 16, (3,) * 16),
        (Text(), "any name", "any name"),
        (CHOICE, "tanh", "tanh"),
        (Switch(), True, True),
        (Switch(), False, False),
    ],
)
def test_validate_returns_the_value_in_the_settings_type(
    kind: Kind, value: Any, stored: object
) -> None:
    valid = kind.validate("size", value)
    assert (valid, type(valid)) == (stored, type(stored))
    if isinstance(valid, tuple):
        assert {type(number) for number in valid} == {int}


@pytest.mark.parametrize(
    ("kind", "value", "expected"),
    [
        (NUMBER, np.nextafter(0.5, 0), "a number from 0.5 to 2"),
        (NUMBER, np.nextafter(2, 3), "a number from 0.5 to 2"),
        *[(NUMBER, value, "a number from") for value in (math.nan, math.inf, -math.inf, 10**400)],
        *[(NUMBER, value, "a number$") for value in (True, "1", None, (1,), 1j)],
        *[(OPTIONAL, value, "a number from") for value in (math.nan, 0, 3)],
        *[(OPTIONAL, value, "a number$") for value in (True, "none")],
        *[(INTEGER, value, "a whole number from 1 to 9") for value in (0, 10, -(10**30))],
        *[(INTEGER, value, "a whole number$") for value in (5.0, 1.5, True, "5", None, (5,))],
        *[(INTEGERS, value, "1 to 16 whole numbers") for value in ((), (3,) * 17, 5, "5", None)],
        *[(INTEGERS, value, "a whole number from 1 to 9") for value in ((0,), (5, 10))],
        *[(INTEGERS, value, "a whole number$") for value in ((1.5,), (5, "5"), (True,))],
        *[(Text(), value, "a name") for value in (5, None, ("tanh",))],
        *[(CHOICE, value, "one of tanh, relu") for value in ("", "Tanh", "tan", "tanh,relu")],
        *[(Switch(), value, "true or false") for value in (0, 1, "true", None)],
    ],
)
def test_other_value_is_refused_with_name_and_expected_values(
    kind: Kind, value: Any, expected: str
) -> None:
    with pytest.raises(kp.ConfigError, match=f"^size is .*; expected {expected}"):
        kind.validate("size", value)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "none"),
        (True, "true"),
        (False, "false"),
        (1e-7, "1e-07"),
        (500, "500"),
        ((512, 256), "512,256"),
        ((8,), "8"),
        ("huber", "huber"),
    ],
)
def test_format_value_returns_the_text_that_a_user_types(value: object, text: str) -> None:
    assert format_value(value) == text
