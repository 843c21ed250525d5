"""A file that is being replaced is the whole old one or the whole new one, whatever happens."""

from __future__ import annotations

import multiprocessing
import os
import resource
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random

import pytest
from save_constantly import save_constantly

import keras_pendulum as kp
from keras_pendulum.storage.atomic_write import write_atomically

LARGE = 4_500_000  # bytes, as a checkpoint of `reference`


@pytest.mark.slow
def test_file_is_complete_after_each_of_300_kills(tmp_path: Path) -> None:
    path = tmp_path / "policy.h5"
    contents = [os.urandom(LARGE) for _ in range(2)]
    path.write_bytes(contents[0])
    random = Random(0)
    # The server has not imported TensorFlow, so its children start fast.
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["save_constantly"])
    contents_found = []
    for _ in range(300):
        before = path.stat().st_mtime_ns
        process = context.Process(target=save_constantly, args=(str(path), contents))
        process.start()
        while path.stat().st_mtime_ns == before:  # until it has saved once
            time.sleep(0.001)
        time.sleep(random.uniform(0, 0.02))
        process.kill()
        process.join()
        contents_found.append(contents.index(path.read_bytes()))
        for temporary in tmp_path.glob(".policy.h5.*.tmp"):
            temporary.unlink()
    assert set(contents_found) == {0, 1}


def test_limit_on_file_size_raises_and_keeps_the_old_file(tmp_path: Path) -> None:
    write_atomically(tmp_path / "a.h5", b"old")
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, hard))
    try:
        with pytest.raises(kp.UserError, match=r"cannot write .*a\.h5: File too large"):
            write_atomically(tmp_path / "a.h5", bytes(2000))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert {file.name: file.read_bytes() for file in tmp_path.iterdir()} == {"a.h5": b"old"}


def test_link_stays_and_its_target_is_replaced(tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    file, link = tmp_path / "elsewhere" / "a.h5", tmp_path / "link.h5"
    file.write_bytes(b"old")
    link.symlink_to("elsewhere/a.h5")
    write_atomically(link, b"new")
    assert link.readlink() == Path("elsewhere/a.h5")
    assert file.read_bytes() == b"new"
    assert [entry.name for entry in file.parent.iterdir()] == ["a.h5"]


def test_missing_folder_raises(tmp_path: Path) -> None:
    with pytest.raises(kp.UserError, match=r"cannot write .*: No such file or directory"):
        write_atomically(tmp_path / "gone" / "a.h5", b"new")


@pytest.fixture
def read_only(tmp_path: Path) -> Iterator[Path]:
    """A folder with an old file that nobody can write in, not even root."""
    folder = Path(tempfile.mkdtemp())
    (folder / "pendulum_weight.h5").write_bytes(b"old")
    folder.chmod(0o555)
    # A user without rights cannot import either, so this imports everything before.
    kp.train_dqn(kp.preset("original", episodes=1, hidden_units=(8,)), tmp_path)
    user = os.geteuid()
    if user == 0:
        os.seteuid(65534)  # root may write in any folder
    try:
        yield folder
    finally:
        os.seteuid(user)
        folder.chmod(0o755)
        shutil.rmtree(folder)


def test_read_only_folder_raises_and_keeps_the_old_file(read_only: Path) -> None:
    old = read_only / "pendulum_weight.h5"
    config = kp.preset("original", episodes=1, hidden_units=(8,))
    attempts: dict[str, Callable[[], object]] = {
        "cannot write": lambda: kp.save_weights(kp.DQN((8,)), old),
        "cannot make the folder": lambda: kp.train_dqn(config, read_only / "run"),
        "cannot write .*pendulum": lambda: kp.train_dqn(config, read_only, overwrite=True),
    }
    for message, attempt in attempts.items():
        with pytest.raises(kp.UserError, match=f"{message}.*: Permission denied"):
            attempt()
    assert {file.name: file.read_bytes() for file in read_only.iterdir()} == {old.name: b"old"}
