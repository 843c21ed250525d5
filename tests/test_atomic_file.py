"""A file that is being replaced is the old one or the new one, whatever happens."""

from __future__ import annotations

import multiprocessing
import os
import resource
import time
from pathlib import Path
from random import Random

import pytest
from save_constantly import save_constantly

import keras_pendulum as kp
from keras_pendulum.atomic_file import write_atomically

LARGE = 4_500_000  # bytes, as a checkpoint of `reference`


def test_none_of_300_kills_leaves_anything_but_a_whole_file(tmp_path: Path) -> None:
    path = tmp_path / "policy.h5"
    contents = [os.urandom(LARGE) for _ in range(2)]
    path.write_bytes(contents[0])
    random = Random(0)
    # The server has imported no TensorFlow, so its children start at once.
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["save_constantly"])
    found = []
    for _ in range(300):
        before = path.stat().st_mtime_ns
        process = context.Process(target=save_constantly, args=(str(path), contents))
        process.start()
        while path.stat().st_mtime_ns == before:  # until it saves
            time.sleep(0.001)
        time.sleep(random.uniform(0, 0.02))
        process.kill()
        process.join()
        found.append(contents.index(path.read_bytes()))
        for left in tmp_path.glob(".policy.h5.*.tmp"):
            left.unlink()
    assert set(found) == {0, 1}


def test_a_limit_on_the_files_size_is_told_and_the_old_file_stays(tmp_path: Path) -> None:
    write_atomically(tmp_path / "a.h5", b"old")
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, hard))
    try:
        with pytest.raises(kp.UserError, match=r"cannot write .*a\.h5: File too large"):
            write_atomically(tmp_path / "a.h5", bytes(2000))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert {file.name: file.read_bytes() for file in tmp_path.iterdir()} == {"a.h5": b"old"}


def test_a_vanished_folder_is_told(tmp_path: Path) -> None:
    with pytest.raises(kp.UserError, match=r"cannot write .*: No such file or directory"):
        write_atomically(tmp_path / "gone" / "a.h5", b"new")
