"""Every message of an error is one printable line of at most 300 characters."""

from __future__ import annotations

import pickle
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from conftest import Refusal

import keras_pendulum as kp
from keras_pendulum.evaluate import __main__ as evaluate
from keras_pendulum.train import __main__ as train


@pytest.mark.parametrize("kind", [kp.UserError, kp.ConfigError, kp.WeightsError])
def test_control_characters_of_a_message_are_escaped(kind: type[kp.UserError]) -> None:
    error = kind("a\nb\r\x1b[31mc\x07\u202ed\udcff: θ ≤ π, “x”")
    assert str(error) == r"a\nb\r\x1b[31mc\x07\u202ed\udcff: θ ≤ π, “x”"
    assert str(pickle.loads(pickle.dumps(error))) == str(error)


def test_long_message_keeps_its_beginning_and_its_end() -> None:
    assert str(kp.UserError("x" * 300)) == "x" * 300
    message = str(kp.UserError(f"first {'x' * 60_000} last"))
    assert len(message) == 300
    assert message.startswith("first xxx")
    assert message.endswith("xxx last")
    assert message.count("…") == 1


@pytest.mark.parametrize(
    ("main", "words"),
    [
        (train.main, ["--\x1b[31mred\n"]),
        (train.main, ["--loss", "x" * 60_000]),
        (train.main, ["--preset", "a\x1b[31m\n" * 9999]),
        (evaluate.main, ["a\x1b[31m\nb"]),
    ],
    ids=["unknown flag", "wrong choice", "unknown preset", "missing file"],
)
def test_command_escapes_and_shortens_its_arguments(
    main: Callable[[list[str]], int], words: list[str], refusal: Refusal
) -> None:
    line = refusal(main, words)
    assert line.removesuffix("\n").isprintable()
    assert len(line) <= len("error: ") + 300 + 1


def test_wrong_types_are_refused_and_the_error_says_what_is_expected(tmp_path: Path) -> None:
    config = kp.preset("original", episodes=1, hidden_units=(8,))
    network = kp.DQN((8,))
    none: Any = None
    path: Any = b"a.h5"
    name: Any = "path"
    wrong: list[tuple[Callable[[], object], str]] = [
        (lambda: kp.train_dqn(none), "config is None; expected Config"),
        (
            lambda: kp.train_dqn(name),
            "config is 'path'; expected Config, such as kp.preset('path')",
        ),
        (lambda: kp.train_dqn(config, init=name), "init is 'path'; expected DQN"),
        (lambda: kp.save_weights(none, tmp_path / "a.h5"), "network is None; expected DQN"),
        (lambda: kp.save_weights(network, path), "path is b'a.h5'; expected str or PathLike"),
        (lambda: kp.load_weights(path), "path is b'a.h5'; expected str or PathLike"),
    ]
    for call, message in wrong:
        with pytest.raises(TypeError, match=f"^{re.escape(message)}$"):
            call()
