"""Every message of an error is one printable line of at most 300 characters."""

from __future__ import annotations

import pickle
from pathlib import Path

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


def test_api_escapes_and_shortens_the_name_of_a_file(tmp_path: Path) -> None:
    with pytest.raises(kp.WeightsError) as caught:
        kp.load_weights(tmp_path / "a\n\x1b[31m")
    assert r"a\n\x1b[31m: no such file" in str(caught.value)
    with pytest.raises(kp.ConfigError) as config_error:
        kp.preset("x" * 60_000)
    assert len(str(config_error.value)) == 300


@pytest.mark.parametrize(
    "words",
    [["--\x1b[31mred\n"], ["--loss", "x" * 60_000], ["--preset", "a\x1b[31m\n" * 9999]],
    ids=["unknown flag", "wrong choice", "unknown preset"],
)
def test_command_escapes_and_shortens_its_arguments(words: list[str], refusal: Refusal) -> None:
    line = refusal(train.main, words)
    assert line.removesuffix("\n").isprintable()
    assert len(line) <= len("error: ") + 300 + 1


def test_command_escapes_the_name_of_a_missing_file(refusal: Refusal) -> None:
    line = refusal(evaluate.main, ["a\x1b[31m\nb"])
    assert line.startswith(r"error: a\x1b[31m\nb: no such file")


def test_wrong_types_are_refused_and_the_error_says_what_is_expected(tmp_path: Path) -> None:
    config = kp.preset("original", episodes=1, hidden_units=(8,))
    network = kp.DQN((8,))
    wrong: dict[str, object] = {
        "config is None; expected Config": lambda: kp.train_dqn(None),  # type: ignore[arg-type]
        "init is 'path'; expected DQN": lambda: kp.train_dqn(
            config,
            init="path",  # type: ignore[arg-type]
        ),
        "network is None; expected DQN": lambda: kp.save_weights(
            None,  # type: ignore[arg-type]
            tmp_path / "a.h5",
        ),
        "path is b'a.h5'; expected str or PathLike": lambda: kp.save_weights(
            network,
            b"a.h5",  # type: ignore[arg-type]
        ),
        "path is b'b.h5'; expected str or PathLike": lambda: kp.load_weights(
            b"b.h5"  # type: ignore[arg-type]
        ),
    }
    for message, call in wrong.items():
        assert callable(call)
        with pytest.raises(TypeError) as caught:
            call()
        assert str(caught.value) == message
