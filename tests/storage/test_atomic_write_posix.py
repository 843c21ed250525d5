"""A file that is being replaced, with the kills, limits, links, pipes and rights of POSIX."""

from __future__ import annotations

import multiprocessing
import os
import shutil
import socket
import stat
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random

import pytest

import keras_pendulum as kp
from keras_pendulum.storage.atomic_write import require_no_other_file, write_atomically

if sys.platform == "win32":
    pytest.skip("needs limits, links, pipes and rights of POSIX", allow_module_level=True)

import resource

LARGE = 4_500_000  # bytes, as a checkpoint of `reference`


def save_constantly(path: str, contents: list[bytes]) -> None:
    """Writes each of the contents to `path`, again and again, until its process is killed."""
    while True:
        for content in contents:
            write_atomically(path, content)


@pytest.mark.slow
def test_file_is_complete_after_each_of_100_kills(tmp_path: Path) -> None:
    path = tmp_path / "policy.h5"
    contents = [os.urandom(LARGE) for _ in range(2)]
    path.write_bytes(contents[0])
    random = Random(0)
    # The server has not imported TensorFlow, so its children start fast.
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([__name__])
    contents_found = []
    for _ in range(100):
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


NO_FILES: dict[str, Callable[[Path], object]] = {
    "pipe": os.mkfifo,
    "socket": lambda path: socket.socket(socket.AF_UNIX).bind(str(path)),
    # A terminal of this process: code that is broken on purpose must not replace /dev/null.
    "device": lambda path: path.symlink_to(os.ttyname(os.openpty()[1])),
    "folder": Path.mkdir,
}


@pytest.mark.parametrize("kind", NO_FILES)
def test_what_is_no_file_is_not_replaced(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "a"
    NO_FILES[kind](path)
    before = path.lstat()
    with pytest.raises(kp.UserError, match=r"cannot write .*a: it is a .*; name a file"):
        write_atomically(path, b"new")
    assert os.path.samestat(path.lstat(), before)
    assert list(tmp_path.iterdir()) == [path]


def test_link_to_an_open_pipe_is_not_replaced(tmp_path: Path) -> None:
    reading, writing = os.pipe()
    try:
        with pytest.raises(kp.UserError, match="it is a device, a pipe or a socket"):
            write_atomically(f"/dev/fd/{writing}", b"new")
    finally:
        os.close(reading)
        os.close(writing)


def test_pipe_is_not_replaced_as_a_file_of_another_kind(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a.gif")
    with pytest.raises(kp.UserError, match=r"a\.gif holds something else than a GIF"):
        require_no_other_file(tmp_path / "a.gif", b"GIF8", "a GIF")


def test_folder_is_flushed_after_the_new_file_is_in_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.h5"
    flushed: list[tuple[str, bool]] = []

    def fsync(descriptor: int) -> None:
        is_folder = stat.S_ISDIR(os.fstat(descriptor).st_mode)
        flushed.append(("folder" if is_folder else "file", path.exists()))
        if is_folder:
            raise OSError(22, "Invalid argument")  # a system that cannot flush a folder

    monkeypatch.setattr(os, "fsync", fsync)
    write_atomically(path, b"new")
    assert flushed == [("file", False), ("folder", True)]
    assert path.read_bytes() == b"new"


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
        r"cannot write .*\.lock": lambda: kp.train_dqn(config, read_only, overwrite=True),
    }
    for message, attempt in attempts.items():
        with pytest.raises(kp.UserError, match=f"{message}.*: Permission denied"):
            attempt()
    assert {file.name: file.read_bytes() for file in read_only.iterdir()} == {old.name: b"old"}
