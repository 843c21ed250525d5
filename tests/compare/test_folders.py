from __future__ import annotations

from pathlib import Path

import pytest

from keras_pendulum.compare.folders import find_checkpoints, short_names
from keras_pendulum.errors import UserError

pytestmark = pytest.mark.quick


@pytest.fixture
def runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Empty files with the names of checkpoints; the process is in their folder."""
    for name in ("a/pendulum_weight.h5", "b/pendulum_weight.h5", "c/a/cartpole_weight.h5"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_checkpoint_of_each_folder_is_found(runs: Path) -> None:
    assert find_checkpoints(["b", "c/a/", str(runs / "a")]) == [
        Path("b/pendulum_weight.h5"),
        Path("c/a/cartpole_weight.h5"),
        runs / "a" / "pendulum_weight.h5",
    ]


@pytest.mark.parametrize(
    ("folders", "message"),
    [
        (["a", "missing"], "missing: no such folder; expected the folder of a run"),
        (["a/pendulum_weight.h5"], "a file; expected the folder of a run"),
        (["c"], r"c: holds no run \(no pendulum_weight.h5 or cartpole_weight.h5\)"),
        (["a", "b", "./a"], r"a and \./a are the same folder: name it once"),
        (["n" * 300], "expected the folder of a run"),
        (["a\0b"], "expected the folder of a run"),
    ],
)
def test_folder_without_a_run_of_its_own_is_refused(
    folders: list[str], message: str, runs: Path
) -> None:
    with pytest.raises(UserError, match=message):
        find_checkpoints(folders)


def test_folder_with_two_runs_is_refused(runs: Path) -> None:
    (runs / "a" / "cartpole_weight.h5").touch()
    with pytest.raises(UserError, match=r"^a: holds pendulum_weight.h5 and cartpole_weight.h5: "):
        find_checkpoints(["a"])


def test_names_have_as_many_parents_as_make_them_different(runs: Path) -> None:
    assert short_names(["a", "b"]) == ["a", "b"]
    assert short_names(["a", "c/a"]) == [f"{runs.name}/a", "c/a"]
    assert short_names(["c/a/."]) == ["a"]
