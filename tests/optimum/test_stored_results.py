from __future__ import annotations

import io
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from keras_pendulum.optimum.solutions import optimal_return
from keras_pendulum.optimum.stored_results import Problem, read_returns, write_arrays

pytestmark = pytest.mark.quick
Array = NDArray[np.float64]


@pytest.fixture
def computed(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Replaces the computation by a fast one; the list has the number of starts of each call."""
    counts: list[int] = []

    def fast_return(gravity: float, starts: Array, steps: int) -> Array:
        counts.append(len(starts))
        return np.asarray(-gravity - np.abs(starts[:, 0]) - 1 / steps)

    monkeypatch.setattr("keras_pendulum.optimum.best_return.best_return", fast_return)
    return counts


def archive(**changes: Any) -> bytes:
    arrays: dict[str, Any] = {
        "gravity": np.float64(9.81),
        "seeds": np.arange(1000),
        "returns": np.full(1000, -7.0),
    }
    buffer = io.BytesIO()
    arrays |= changes
    np.savez_compressed(
        buffer, **{key: array for key, array in arrays.items() if array is not None}
    )
    return buffer.getvalue()


def write_returns(path: Path, problem: Problem, returns: dict[int, float]) -> None:
    arrays = {"seeds": np.array(list(returns)), "returns": np.array(list(returns.values()))}
    write_arrays(path, problem._asdict() | arrays)


def test_returns_are_computed_once_and_stored_with_later_seeds(
    optimum_cache: Path, computed: list[int]
) -> None:
    first = optimal_return(9.81, [3, 2000])
    np.testing.assert_array_equal(optimal_return(9.81, [3, 2000, 999])[:2], first)
    assert computed == [1001]  # seeds 0 to 999, and 2000
    optimal_return(9.81, [2000, 2001])
    optimal_return(9.81, [2001, 2000, 0])
    assert computed == [1001, 1]
    optimal_return(1.0, np.array([5, 10_000]))
    assert computed == [1001, 1, 1]  # the package contains seed 5
    assert sorted(path.name for path in optimum_cache.iterdir()) == [
        "gravity_1.npz",
        "gravity_9.81.npz",
    ]


def test_file_without_steps_and_discount_is_one_of_200_steps(
    optimum_cache: Path, computed: list[int]
) -> None:
    optimum_cache.mkdir()
    (optimum_cache / "gravity_9.81.npz").write_bytes(archive())
    assert optimal_return(9.81, [4]) == [-7.0]
    assert not computed


# -(π² + 0.1·8² + 0.001·2²) for each step: hanging down at full speed with the full torque.
LOWEST = {1: -16.2736044, 60: -976.416264, 200: -3254.72088}  # by steps


@pytest.mark.parametrize("steps", LOWEST)
@pytest.mark.parametrize(
    ("share", "plausible"), [(1 - 1e-8, True), (1 + 1e-8, False), (0, True), (-1e-300, False)]
)
def test_returns_between_the_lowest_possible_one_and_0_are_plausible(
    steps: int, share: float, plausible: bool, tmp_path: Path
) -> None:
    path, value, problem = tmp_path / "a.npz", share * LOWEST[steps], Problem.valid(1.0, steps)
    for returns in ({0: value}, {0: -1.0, 1: value, 2: -2.0}):
        write_returns(path, problem, returns)
        assert read_returns(path, problem) == (returns if plausible else {})


def test_name_of_a_file_says_what_departs_from_the_usual() -> None:
    names = {
        Problem.valid(10): "gravity_10.npz",
        Problem.valid(9.81, 60): "gravity_9.81_steps_60.npz",
        Problem.valid(-0.0, 60, 0.5): "gravity_0_steps_60_discount_0.5.npz",
        Problem.valid(1, discount=-0.0): "gravity_1_discount_0.npz",
    }
    assert [problem.file_name for problem in names] == list(names.values())


def test_file_belongs_to_one_problem(tmp_path: Path) -> None:
    problem = Problem.valid(1.0, 60, 0.9)
    write_returns(tmp_path / "a.npz", problem, {3: -7.0})
    assert read_returns(tmp_path / "a.npz", problem) == {3: -7.0}
    for change in ({"gravity": 1.1}, {"steps": 61}, {"discount": 0.8}):
        assert read_returns(tmp_path / "a.npz", problem._replace(**change)) == {}


@pytest.mark.parametrize(
    "content",
    [
        b"not an archive",
        archive()[:-30],
        archive(gravity=np.float64(9.8)),
        archive(gravity=np.array([9.81])),
        archive(steps=np.int64(60)),
        archive(steps=np.array([200])),
        archive(returns=np.full(1000, np.nan)),
        archive(returns=np.full(999, -7.0)),
        archive(returns=np.full(1000, -7.0, np.float32)),
        archive(returns=np.full(1000, -7.0, object)),
        archive(seeds=np.arange(1000.0)),
        archive(seeds=np.zeros((1000, 1), np.int64), returns=np.full((1000, 1), -7.0)),
        archive(seeds=np.int64(4), returns=np.float64(-7)),
        archive(returns=None),
    ],
)
def test_damaged_or_foreign_cache_is_computed_again_and_replaced(
    content: bytes, optimum_cache: Path, computed: list[int]
) -> None:
    optimum_cache.mkdir()
    (optimum_cache / "gravity_9.81.npz").write_bytes(content)
    returns = optimal_return(9.81, range(5))
    assert (returns < -9).all()
    assert computed == [1000]
    np.testing.assert_array_equal(optimal_return(9.81, range(5)), returns)
    assert computed == [1000]
    assert [path.name for path in optimum_cache.iterdir()] == ["gravity_9.81.npz"]


class MakesAFile:
    """An object whose unpickling makes the file `made`."""

    def __reduce__(self) -> tuple[Any, ...]:
        return Path.touch, (Path("made"),)


def test_nothing_in_a_cache_is_unpickled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("a.npz").write_bytes(archive(returns=np.array([MakesAFile()])))
    assert read_returns(Path("a.npz"), Problem.valid(9.81)) == {}
    assert not Path("made").exists()


def test_file_with_a_flipped_bit_never_gives_another_return(tmp_path: Path) -> None:
    path, problem = tmp_path / "gravity_9.81.npz", Problem.valid(9.81, 60)
    returns = {seed: -seed / 7 for seed in range(10)}
    write_returns(path, problem, returns)
    valid = path.read_bytes()
    for position in range(len(valid)):
        data = bytearray(valid)
        data[position] ^= 0x01
        path.write_bytes(data)
        assert read_returns(path, problem) in ({}, returns)


def test_unwritable_cache_folder_is_ignored(
    tmp_path: Path, computed: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("not a folder")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert (optimal_return(9.81, range(5)) < -9).all()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    (tmp_path / "keras_pendulum" / "gravity_9.81.npz").mkdir(parents=True)
    assert (optimal_return(9.81, range(5)) < -9).all()
    assert computed == [1000, 1000]


def test_returns_are_computed_for_a_user_without_a_home_folder(
    computed: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_home(path: Path) -> Path:
        raise RuntimeError("Could not determine home directory.")

    shipped = optimal_return(1.0, range(5))
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(Path, "expanduser", no_home)
    np.testing.assert_array_equal(optimal_return(1.0, range(5)), shipped)
    first, second = (optimal_return(9.81, range(5)) for _ in range(2))
    np.testing.assert_array_equal(first, second)
    assert computed == [1000, 1000]  # without a cache folder, each call computes


def test_stored_returns_are_read_without_heavy_imports() -> None:
    code = (
        "import sys\n"
        "from keras_pendulum.optimum.solutions import optimal_return\n"
        "optimal_return()\n"
        "assert not {'tensorflow', 'keras', 'gymnasium', 'matplotlib'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
