"""Damage to a file of this package is always detected: its checksum covers every bit."""

from __future__ import annotations

import io
from collections.abc import Callable
from functools import partial
from pathlib import Path
from random import Random

import pytest

import keras_pendulum as kp
from keras_pendulum.storage.hdf5_reader import copy_content
from keras_pendulum.train.checkpoint import load_checkpoint

pytestmark = pytest.mark.slow

CONFIG = kp.preset("reference", episodes=1, hidden_units=(16, 8), replay_capacity=1000)


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """The checkpoint of a short run."""
    folder = tmp_path_factory.mktemp("run")
    kp.train_dqn(CONFIG, folder)
    return (folder / "pendulum_weight.h5").read_bytes()


def check_refused(load: Callable[[Path], object], path: Path, content: bytes | bytearray) -> None:
    path.write_bytes(content)
    with pytest.raises(kp.WeightsError) as caught:
        load(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def damaged(content: bytes | bytearray) -> bool:
    """Returns whether the reader of the files refuses the content, without its process."""
    try:
        copy_content(io.BytesIO(content), len(content), io.BytesIO())
    except (OSError, kp.WeightsError):  # HDF5 itself refuses a truncated file
        return True
    return False


def test_1000_flipped_bits_are_all_refused(checkpoint: bytes, tmp_path: Path) -> None:
    random = Random(0)
    for i in range(1000):
        flipped = bytearray(checkpoint)
        flipped[random.randrange(len(flipped))] ^= 1 << random.randrange(8)
        assert damaged(flipped)
        if i < 2:
            for load in (kp.load_weights, partial(load_checkpoint, config=CONFIG)):
                check_refused(load, tmp_path / "flipped.h5", flipped)


@pytest.mark.parametrize("size", [1, 8, 512, 4096])
def test_zeroed_blocks_are_refused(size: int, checkpoint: bytes) -> None:
    random = Random(size)
    for _ in range(50):
        start = random.randrange(len(checkpoint) - size)
        zeroed = checkpoint[:start] + bytes(size) + checkpoint[start + size :]
        assert damaged(zeroed) or zeroed == checkpoint  # the block was zero before


def test_truncated_files_and_bytes_behind_the_checksum_are_refused(
    checkpoint: bytes, tmp_path: Path
) -> None:
    assert not damaged(checkpoint)
    assert damaged(checkpoint + b"\n")
    end = checkpoint.rindex(b"\nkeras_pendulum sha256")  # of the HDF5 content
    near_the_ends = (1, 7, 8, 9, 100, 511, 512, 2048, end - 4096, end - 8, end - 1, end + 1)
    for length in (*near_the_ends, len(checkpoint) - 1, *range(0, end, 4999)):
        assert damaged(checkpoint[:length]), length
    for length in (1, end // 2, end - 1):
        check_refused(kp.load_weights, tmp_path / "short.h5", checkpoint[:length])


def test_file_without_checksum_loads(checkpoint: bytes, tmp_path: Path) -> None:
    end = checkpoint.rindex(b"\nkeras_pendulum sha256")
    (tmp_path / "plain.h5").write_bytes(checkpoint[:end])
    load_checkpoint(tmp_path / "plain.h5", CONFIG)
