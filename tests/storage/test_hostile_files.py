"""Hostile files, made to crash, to cost time or memory or to read other files, are refused."""

from __future__ import annotations

import shutil
import threading
from collections.abc import Iterator
from pathlib import Path
from random import Random

import pytest
from conftest import Command
from fuzz_files import LAYOUTS, fuzz
from hostile_files import HOSTILE, write, write_sound
from load_files import Loader, Outcome

import keras_pendulum as kp

MOST_MEMORY = 60  # MB
LONGEST_MESSAGE = 1000  # characters beside the path


@pytest.fixture(scope="module")
def loader(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Loader]:
    path = tmp_path_factory.mktemp("sound") / "sound.h5"
    kp.save_weights(kp.DQN((16, 8), 5), path)
    with Loader(path) as loader:
        yield loader


def check_refusal(outcome: Outcome, path: Path) -> None:
    """Raises AssertionError unless the file was refused in one printable line with its path."""
    assert outcome.kind == "refused", outcome
    assert str(path) in outcome.text
    assert outcome.text.isprintable()
    assert len(outcome.text) - len(str(path)) < LONGEST_MESSAGE


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "layout"), HOSTILE)
def test_hostile_file_is_refused_in_one_line_or_loads_unchanged(
    kind: str, layout: str, loader: Loader, tmp_path: Path
) -> None:
    folder = tmp_path / "folder"
    folder.mkdir()
    sound = write_sound(tmp_path / ("b.keras" if layout == "keras" else "b.h5"), layout)
    expected = loader.load(sound)
    assert expected.kind == "loaded", expected
    path = write(kind, layout, folder)
    for function in ("load_weights", "load_config"):
        outcome = loader.load(path, function)
        if (outcome.kind, outcome.text) != ("loaded", expected.text):
            check_refusal(outcome, path)
        assert outcome.memory < MOST_MEMORY
        assert outcome.child_memory < MOST_MEMORY
    assert [file.name for file in folder.iterdir()] == [path.name]
    assert not (tmp_path / "outside.txt").exists()


@pytest.mark.parametrize("layout", ["Keras 3", "keras"])
def test_file_that_is_cut_short_while_it_is_read_is_refused_or_loads_unchanged(
    layout: str, loader: Loader, tmp_path: Path
) -> None:
    path = write_sound(tmp_path / ("a.keras" if layout == "keras" else "a.h5"), layout)
    content = path.read_bytes()
    expected = loader.load(path)
    random = Random(0)
    stopped = threading.Event()

    def cut_and_mend() -> None:
        while not stopped.is_set():
            with open(path, "r+b") as file:
                file.truncate(random.randrange(len(content)))
            path.write_bytes(content)

    thread = threading.Thread(target=cut_and_mend)
    thread.start()
    try:
        for _ in range(50):
            outcome = loader.load(path)
            if (outcome.kind, outcome.text) != ("loaded", expected.text):
                check_refusal(outcome, path)
    finally:
        stopped.set()
        thread.join()


@pytest.mark.parametrize("layout", ["this package", "Keras 3", "keras"])
def test_evaluate_refuses_a_circular_file_in_one_line(
    layout: str, command: Command, tmp_path: Path
) -> None:
    path = write("a B-tree node that is its child", layout, tmp_path)
    done = command("evaluate", path.name)
    (line,) = done.stderr.splitlines()
    assert (done.returncode, done.stdout) == (2, "")
    assert line.startswith(f"error: {path.name}: ")


@pytest.mark.parametrize(
    "kind", ["a B-tree node that is its child", "a heap with a circular free list"]
)
def test_resume_refuses_a_hostile_checkpoint_in_one_line(
    kind: str, command: Command, tmp_path: Path
) -> None:
    (tmp_path / "run").mkdir()
    path = write(kind, "this package", tmp_path / "run")
    path.rename(tmp_path / "run" / "pendulum_weight.h5")
    done = command("train", "--resume", "--out", "run")
    (line,) = done.stderr.splitlines()
    assert (done.returncode, done.stdout) == (2, "")
    assert line.startswith("error: ")
    assert "pendulum_weight.h5" in line


@pytest.mark.slow
def test_500_fuzzed_files_are_refused_or_load_quickly(tmp_path: Path) -> None:
    for row, failures in fuzz(500 // len(LAYOUTS), tmp_path):
        assert failures == [], row
        assert row["refused"] > 0
        assert row["loaded, equal"] > 0
        assert row["memory, MB"] < MOST_MEMORY
        assert row["memory of the child, MB"] < MOST_MEMORY
    shutil.rmtree(tmp_path)
