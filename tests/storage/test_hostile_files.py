"""Hostile files, made to crash, to cost time or memory or to read other files, are refused."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path
from random import Random

import pytest
from fuzz_files import fuzz, kind_of
from hostile_files import BY_H5PY, HOSTILE, KERNEL, LAYOUTS, write, write_sound
from load_files import Loader

pytestmark = pytest.mark.slow

MOST_MEMORY = 60  # MB, and for the reader twice the size of the file
PROCESSOR_TIME = 0.5  # s; the reader of a small file takes 0.02 s after its imports
# The benchmark loads each file in each layout. A change by h5py is the same in all of them.
CASES = [
    (kind, layout)
    for kind, layout in HOSTILE
    if kind not in BY_H5PY or layout == [*KERNEL][[*BY_H5PY].index(kind) % 3]
]


@pytest.fixture(scope="module")
def loader(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Loader]:
    sound = write_sound("this package", tmp_path_factory.mktemp("sound"))
    with Loader(sound, endless=300, processor_time=PROCESSOR_TIME) as loader:
        yield loader


@pytest.fixture(scope="module")
def expected(loader: Loader, tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """The digest of the network in a sound file of each layout."""
    folder = tmp_path_factory.mktemp("sound")
    outcomes = {layout: loader.load(write_sound(layout, folder)) for layout in LAYOUTS}
    assert {outcome.kind for outcome in outcomes.values()} == {"loaded"}
    return {layout: outcome.text for layout, outcome in outcomes.items()}


@pytest.mark.parametrize(("kind", "layout"), CASES)
def test_hostile_file_is_refused_in_one_line_or_loads_unchanged(
    kind: str, layout: str, loader: Loader, expected: dict[str, str], tmp_path: Path
) -> None:
    folder = tmp_path / "folder"
    path = write(kind, layout, folder)
    outcome = loader.load(path)
    assert kind_of(outcome, expected[layout], path) in ("equal", "refused"), outcome
    assert outcome.memory < MOST_MEMORY
    assert outcome.child_memory < MOST_MEMORY + 2 * path.stat().st_size / 1e6
    assert [file.name for file in folder.iterdir()] == [path.name]
    assert not (tmp_path / "outside.txt").exists()


@pytest.mark.parametrize("layout", ["Keras 3", "keras"])
def test_file_that_is_cut_short_while_it_is_read_is_refused_or_loads_unchanged(
    layout: str, loader: Loader, expected: dict[str, str], tmp_path: Path
) -> None:
    path = write_sound(layout, tmp_path)
    content = path.read_bytes()
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
        for _ in range(10):
            outcome = loader.load(path)
            assert kind_of(outcome, expected[layout], path) in ("equal", "refused"), outcome
    finally:
        stopped.set()
        thread.join()


@pytest.mark.parametrize("layout", LAYOUTS)
def test_files_damaged_at_random_are_refused_or_load(
    layout: str, loader: Loader, tmp_path: Path
) -> None:
    row, failures = fuzz(layout, 8, loader, tmp_path)
    assert failures == [], row
    assert row["refused"] > 0
    assert row["memory, MB"] < MOST_MEMORY
    assert row["memory of the child, MB"] < MOST_MEMORY
