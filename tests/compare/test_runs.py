"""The folders that `compare` accepts, and the names of their runs."""

from __future__ import annotations

from pathlib import Path

import pytest

from keras_pendulum.compare.__main__ import _find_runs
from keras_pendulum.compare.runs import short_names
from keras_pendulum.errors import UserError


@pytest.fixture
def runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Empty files with the names of checkpoints; the process is in their folder."""
    for name in ("a/pendulum_weight.h5", "b/pendulum_weight.h5", "c/a/cartpole_weight.h5"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_checkpoint_of_each_folder_is_found(runs: Path) -> None:
    found = [run.weights for run in _find_runs(["b", "c/a/", str(runs / "a")])]
    names = ["b/pendulum_weight.h5", "c/a/cartpole_weight.h5", "a/pendulum_weight.h5"]
    assert found == [(runs / name).resolve() for name in names]


@pytest.mark.parametrize(
    ("folders", "message"),
    [
        (["a", "a"], "a and a are the same folder: name it once"),
        (["a", "b", "./a"], r"a and \./a are the same folder"),
        (["c"], r"c: holds no run \(no pendulum_weight.h5 or cartpole_weight.h5\)"),
        (["n" * 300], "expected the folder of a run"),
        (["a\0b"], "expected the folder of a run"),
    ],
)
def test_folder_without_a_run_of_its_own_is_refused(
    folders: list[str], message: str, runs: Path
) -> None:
    with pytest.raises(UserError, match=message):
        _find_runs(folders)


def test_names_have_as_many_parents_as_make_them_different(runs: Path) -> None:
    assert short_names(["a", "b"]) == ["a", "b"]
    assert short_names(["a", "c/a"]) == [f"{runs.name}/a", "c/a"]
    assert short_names(["c/a/."]) == ["a"]
    assert short_names(["/", "a"]) == ["/", "a"]
