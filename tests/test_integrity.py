"""Damage to a file of ours never gets in: every bit is under the digest behind it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from random import Random

import pytest

import keras_pendulum as kp
from keras_pendulum.checkpoint import load_checkpoint


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """A checkpoint of a run that has learned."""
    folder = tmp_path_factory.mktemp("run")
    kp.train_dqn(CONFIG, folder)
    return (folder / "pendulum_weight.h5").read_bytes()


CONFIG = kp.preset("reference", episodes=43, hidden_units=(16, 8), replay_capacity=1000)


def refused(load: Callable[[Path], object], path: Path, content: bytes | bytearray) -> bool:
    path.write_bytes(content)
    try:
        load(path)
    except kp.WeightsError as error:
        assert str(path) in str(error)
        assert "\n" not in str(error)
        return True
    return False


def resume(path: Path) -> object:
    return load_checkpoint(path, CONFIG)


def test_none_of_500_flipped_bits_gets_in(checkpoint: bytes, tmp_path: Path) -> None:
    random = Random(0)
    for _ in range(500):
        flipped = bytearray(checkpoint)
        flipped[random.randrange(len(flipped))] ^= 1 << random.randrange(8)
        for load in (kp.load_weights, resume):
            assert refused(load, tmp_path / "flipped.h5", flipped)


@pytest.mark.parametrize("size", [1, 8, 512, 4096])
def test_no_zeroed_block_gets_in(size: int, checkpoint: bytes, tmp_path: Path) -> None:
    random = Random(size)
    for _ in range(50):
        start = random.randrange(len(checkpoint) - size)
        if not any(checkpoint[start : start + size]):
            continue  # it was zero before
        zeroed = checkpoint[:start] + bytes(size) + checkpoint[start + size :]
        assert refused(kp.load_weights, tmp_path / "zeroed.h5", zeroed)


def test_no_shortened_file_gets_in(checkpoint: bytes, tmp_path: Path) -> None:
    whole = checkpoint.rindex(b"\nkeras_pendulum sha256")  # only the digest is behind it
    lengths = {
        len(checkpoint) - 1,
        whole + 1,
        0,
        1,
        7,
        8,
        9,
        100,
        511,
        512,
        2048,
        whole // 2,
        whole - 4096,
        whole - 8,
        whole - 1,
    }
    for length in sorted(lengths | set(range(0, whole, 4999))):
        assert refused(kp.load_weights, tmp_path / "short.h5", checkpoint[:length]), length


def test_a_file_with_half_a_digest_or_more_than_one_is_refused(
    checkpoint: bytes, tmp_path: Path
) -> None:
    whole = checkpoint.rindex(b"\nkeras_pendulum sha256")
    for content in (checkpoint[:-1], checkpoint[: whole + 1], checkpoint + b"\n"):
        assert refused(kp.load_weights, tmp_path / "tail.h5", content)


def test_a_file_without_a_digest_loads_as_keras_own_do(checkpoint: bytes, tmp_path: Path) -> None:
    whole = checkpoint.rindex(b"\nkeras_pendulum sha256")
    assert not refused(resume, tmp_path / "plain.h5", checkpoint[:whole])
