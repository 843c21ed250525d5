"""The best possible return: the published values, the search on cliffs, the files."""

from __future__ import annotations

import functools
import io
import itertools
import subprocess
import sys
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from numpy.typing import NDArray

from keras_pendulum import known_returns, optimum
from keras_pendulum.command_line import run_command
from keras_pendulum.optimum import optimal_return
from keras_pendulum.value_tables import greedy_return, solve, value_tables

Array = NDArray[np.float64]


def pendulum(gravity: float) -> Any:
    return gymnasium.make("Pendulum-v1", g=gravity, disable_env_checker=True).unwrapped


def starts(count: int) -> Array:
    env = pendulum(1.0)
    return np.array([(env.reset(seed=seed), env.state)[1] for seed in range(count)])


@functools.lru_cache(maxsize=1)
def coarse_tables(gravity: float) -> list[NDArray[np.float32]]:
    return list(itertools.islice(value_tables(gravity, 100), 200))


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "keras_pendulum"


@pytest.fixture
def computed(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Computing is replaced by a quick stand-in; the list tells how many starts each call got."""
    counts: list[int] = []

    def stand_in(gravity: float, states: Array, steps: int) -> Array:
        counts.append(len(states))
        return np.asarray(-gravity - np.abs(states[:, 0]) - 1 / steps)

    monkeypatch.setattr(optimum, "_best_return", stand_in)
    return counts


@pytest.fixture
def searched(monkeypatch: pytest.MonkeyPatch) -> list[Array]:
    """Nothing is searched; the list tells from which starts it would have been."""
    asked: list[Array] = []

    def stand_in(table: NDArray[np.float32], gravity: float, start: Array, steps: int) -> float:
        asked.append(start)
        return -np.inf

    monkeypatch.setattr(optimum, "_searched_return", stand_in)
    return asked


def use_tables(monkeypatch: pytest.MonkeyPatch, tables: list[NDArray[np.float32]]) -> None:
    """Nothing is solved: `tables` are taken for those of every step, and the last for the start's.

    Coarse tables have more and wider cliffs than the fine one.
    """
    monkeypatch.setattr(optimum, "solve", lambda gravity, steps: tables[-1])
    monkeypatch.setattr(optimum, "value_tables", lambda gravity, cells: iter(tables))


@pytest.mark.parametrize(
    ("gravity", "steps", "count", "lowest", "highest"),
    [
        (1, 200, 100, -36.68 - 0.05, -36.68 + 0.05),
        (1, 200, 1000, -40.69 - 0.05, -40.69 + 0.05),
        (10, 200, 100, -132.7 - 0.05, -132.3),  # -132.7 was published, but two catches more can be
        (10, 200, 1000, -135.5 - 0.3, -135.5 + 0.3),
        (10, 60, 100, -131.90, -131.88),  # these two are not published, but our own
        (10, 60, 1000, -135.17, -135.15),
    ],
)
def test_shipped_returns_have_the_published_means(
    gravity: float,
    steps: int,
    count: int,
    lowest: float,
    highest: float,
    cache: Path,
    computed: list[int],
) -> None:
    returns = optimal_return(gravity, range(count), steps)
    assert returns.dtype == np.float64
    assert returns.shape == (count,)
    assert lowest < returns.mean() < highest
    assert not computed
    assert not cache.exists()


@pytest.mark.parametrize(
    ("gravity", "steps", "each", "mean"),
    [(1.0, 200, 0.02, 0.01), (10.0, 200, 40.0, 1.0), (10.0, 60, 40.0, 1.0)],
)
def test_shipped_returns_are_those_of_the_code_and_no_coarse_policy_beats_them(
    gravity: float, steps: int, each: float, mean: float
) -> None:
    gain = optimal_return(gravity, range(100), steps) - greedy_return(
        coarse_tables(gravity)[:steps], gravity, starts(100)
    )
    assert gain.min() > -1e-6
    assert gain.max() < each  # at g = 10 a coarse policy misses whole catches
    assert gain.mean() < mean
    assert np.median(gain) < 0.3


def test_short_episodes_lose_no_more_than_the_best_long_ones_in_as_many_steps() -> None:
    short, long = (optimal_return(10.0, range(10_000), steps) for steps in (60, 200))
    assert (short >= long).mean() > 0.99  # no step earns anything
    assert (short[:1000] > long[:1000] - 0.2).all()
    cut = greedy_return([coarse_tables(10.0)[-1]] * 60, 10.0, starts(1000))
    assert (short[:1000] > cut - 0.2).all()
    assert (short[:1000] > cut).mean() > 0.9


@pytest.mark.parametrize("steps", [1, 2])
def test_returns_of_one_and_two_steps_are_those_of_trying_all(steps: int) -> None:
    env = pendulum(10.0)

    def attained(start: Array, torques: list[float]) -> float:
        env.state, env.last_u = start, None
        return float(sum(env.step(np.array([torque]))[1] for torque in torques))

    states = starts(20)
    every = [
        [*before, 0.0] for before in itertools.product(np.linspace(-2, 2, 41), repeat=steps - 1)
    ]
    best = [max(attained(start, torques) for torques in every) for start in states]
    np.testing.assert_allclose(optimum._best_return(10.0, states, steps), best, atol=1e-9)


@pytest.mark.parametrize(
    ("seed", "lowest"), [(28, -215.1), (657, -217.7), (535, -259.6), (855, -269.1)]
)
def test_shipped_returns_on_cliffs_are_those_that_a_search_attains(
    seed: int, lowest: float
) -> None:
    assert optimal_return(10.0, [seed])[0] > lowest  # 17, 22, 1.2 and 1.2 more than without


def test_search_finds_what_the_greedy_policies_miss(monkeypatch: pytest.MonkeyPatch) -> None:
    tables = coarse_tables(10.0)
    use_tables(monkeypatch, tables)
    states = starts(835)[[0, 34, 53, 93, 834]]  # V is too low at three and too high at the last
    at_start = greedy_return([tables[-1]] * 200, 10.0, states)
    best = np.maximum(at_start, greedy_return(tables, 10.0, states))
    gain = optimum._best_return(10.0, states, 200) - best
    assert (gain >= 0).all()
    assert (gain > [-1, 0.5, 2, 10, 1]).all()


def test_search_tries_every_torque_in_three_steps() -> None:
    env, start = pendulum(10.0), np.array([2.5, 1.0])

    def attained(torques: list[float]) -> float:
        env.state, env.last_u = start, None
        return float(sum(env.step(np.array([torque]))[1] for torque in torques))

    path: list[float] = []
    best = []
    for _ in range(3):
        tries = [[*path, torque] for torque in np.linspace(-2, 2, 41)]
        path = max(tries, key=lambda torques: attained(torques + [0.0] * (20 - len(torques))))
        best.append(attained(path + [0.0] * (20 - len(path))))
    assert best[0] < best[1] - 1 < best[2] - 2
    nothing = np.zeros((3201, 101), np.float32)  # a policy greedy on it lets the pendulum swing
    assert optimum._searched_return(nothing, 10.0, start, 20) == pytest.approx(best[2], abs=1e-9)
    assert optimum._searched_return(nothing, 10.0, start, 1) == pytest.approx(attained([0.0]))


def test_where_value_and_attained_returns_agree_nothing_is_searched(
    monkeypatch: pytest.MonkeyPatch, searched: list[Array]
) -> None:
    use_tables(monkeypatch, [solve(1.0, theta_cells=200)] * 200)
    gap = optimum._best_return(1.0, starts(100), 200) - optimal_return(1.0)
    assert np.abs(gap).max() < 0.01
    assert not searched


def test_tables_of_each_step_serve_where_the_pendulum_cannot_be_stood_up(
    monkeypatch: pytest.MonkeyPatch, searched: list[Array]
) -> None:
    tables = coarse_tables(20.0)
    use_tables(monkeypatch, tables)
    at_start_only = greedy_return([tables[-1]] * 200, 20.0, starts(30)).mean()
    assert optimum._best_return(20.0, starts(30), 200).mean() > at_start_only + 30
    assert len(searched) < 5  # the search goes on with the other policy, the worse one here


@pytest.mark.parametrize(("steps", "cells"), [(200, 100), (60, 333), (2, 1600)])
def test_the_tables_of_fewer_steps_are_finer_in_the_same_memory(
    steps: int, cells: int, monkeypatch: pytest.MonkeyPatch, searched: list[Array]
) -> None:
    asked: list[int] = []
    nothing = np.zeros((3201, 101), np.float32)

    def stand_in(gravity: float, theta_cells: int) -> Any:
        asked.append(theta_cells)
        return itertools.repeat(nothing)

    monkeypatch.setattr(optimum, "solve", lambda gravity, steps: nothing)
    monkeypatch.setattr(optimum, "value_tables", stand_in)
    optimum._best_return(10.0, starts(1), steps)
    assert asked == [cells]


@pytest.mark.parametrize("gravity", [-0.1, 100.5, np.nan, np.inf, "heavy", None])
def test_bad_gravity_is_told_in_one_line(gravity: Any) -> None:
    with pytest.raises(ValueError, match=r"gravity is .*; expected a number from 0 to 100") as info:
        optimal_return(gravity)
    assert "\n" not in str(info.value)


@pytest.mark.parametrize("seed", [-1, 2**32])
def test_bad_seed_is_told(seed: int) -> None:
    with pytest.raises(ValueError, match=f"seed is {seed}; expected 0 to"):
        optimal_return(1.0, [seed])


@pytest.mark.parametrize("steps", [-1, 0, 201])
def test_bad_steps_are_told(steps: int) -> None:
    with pytest.raises(ValueError, match=f"steps is {steps}; expected 1 to 200"):
        optimal_return(1.0, [0], steps)


def test_seeds_may_come_in_any_order_twice_and_not_at_all(cache: Path) -> None:
    first = optimal_return(1.0, range(10))
    np.testing.assert_array_equal(optimal_return(1.0, iter([7, 2, 7])), first[[7, 2, 7]])
    assert optimal_return(1.0, np.arange(3)).tolist() == first[:3].tolist()
    assert optimal_return(1.0, []).shape == (0,)


def test_returns_are_computed_once_and_new_seeds_join_them(
    cache: Path, computed: list[int]
) -> None:
    first = optimal_return(9.81, [3, 2000])
    np.testing.assert_array_equal(optimal_return(9.81, [3, 2000, 999])[:2], first)
    assert computed == [1001]  # the usual seeds 0 to 999, and 2000
    optimal_return(9.81, [2000, 2001])
    optimal_return(9.81, [2001, 2000, 0])
    assert computed == [1001, 1]
    optimal_return(1.0, np.array([5, 10_000]))
    assert computed == [1001, 1, 1]  # seed 5 came with the package
    assert sorted(path.name for path in cache.iterdir()) == ["gravity_1.npz", "gravity_9.81.npz"]


def test_each_number_of_steps_has_a_file_of_its_own(cache: Path, computed: list[int]) -> None:
    whole, short = (optimal_return(9.81, [3], steps)[0] for steps in (200, 60))
    assert whole - short == pytest.approx(1 / 60 - 1 / 200)
    assert [optimal_return(9.81, [3], steps)[0] for steps in (200, 60)] == [whole, short]
    assert computed == [1000, 1000]
    names = ["gravity_9.81.npz", "gravity_9.81_steps_60.npz"]
    assert sorted(path.name for path in cache.iterdir()) == names


def archive(**changes: Any) -> bytes:
    arrays: dict[str, Any] = {
        "gravity": np.float64(9.81),
        "seeds": np.arange(1000),
        "returns": np.full(1000, -7.0),
    }
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **{**arrays, **changes})
    return buffer.getvalue()


def test_sound_cache_is_believed(cache: Path, computed: list[int]) -> None:
    cache.mkdir()
    (cache / "gravity_9.81.npz").write_bytes(archive())
    assert optimal_return(9.81, [4]) == [-7.0]
    assert not computed


def incomplete() -> bytes:
    buffer = io.BytesIO()
    np.savez_compressed(buffer, gravity=np.float64(9.81), seeds=np.arange(1000))
    return buffer.getvalue()


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"not an archive",
        archive()[:-30],
        archive()[:100],
        archive(gravity=np.float64(9.8)),
        archive(gravity=np.array([9.81])),
        archive(gravity=np.array("9.81")),
        archive(steps=np.int64(60)),
        archive(returns=np.full(1000, np.nan)),
        archive(returns=np.full(1000, -np.inf)),
        archive(returns=np.full(1000, 1.0)),
        archive(returns=np.full(1000, -4000.0)),
        archive(returns=np.full(999, -7.0)),
        archive(returns=np.full(1000, -7.0, np.float32)),
        archive(returns=np.full(1000, -7.0, object)),
        archive(seeds=np.arange(1000.0)),
        archive(seeds=np.zeros((1000, 1), np.int64), returns=np.full((1000, 1), -7.0)),
        archive(seeds=np.int64(4), returns=np.float64(-7)),
        incomplete(),
    ],
)
def test_damaged_or_foreign_cache_is_computed_anew(
    content: bytes, cache: Path, computed: list[int]
) -> None:
    cache.mkdir()
    (cache / "gravity_9.81.npz").write_bytes(content)
    returns = optimal_return(9.81, range(5))
    assert (returns < -9).all()
    assert computed == [1000]
    np.testing.assert_array_equal(optimal_return(9.81, range(5)), returns)
    assert computed == [1000]  # the file has been replaced by a sound one
    assert [path.name for path in cache.iterdir()] == ["gravity_9.81.npz"]


@pytest.mark.parametrize(
    "content",
    [
        archive(),
        archive(steps=np.int64(61)),
        archive(steps=np.array([60])),
        archive(steps=np.int64(60), returns=np.full(1000, -1000.0)),
    ],
)
def test_cache_of_other_steps_is_computed_anew(
    content: bytes, cache: Path, computed: list[int]
) -> None:
    cache.mkdir()
    (cache / "gravity_9.81_steps_60.npz").write_bytes(content)
    returns = optimal_return(9.81, range(5), 60)
    assert ((returns < -9) & (returns > -13)).all()
    assert computed == [1000]


@pytest.mark.parametrize("steps", [60, 200])
def test_no_flipped_bit_is_read_as_another_return(steps: int, tmp_path: Path) -> None:
    path = tmp_path / "gravity_9.81.npz"
    returns = {seed: -seed / 7 for seed in range(10)}
    known_returns.write(path, 9.81, steps, returns)
    sound = path.read_bytes()
    for position in range(len(sound)):
        data = bytearray(sound)
        data[position] ^= 0x01
        path.write_bytes(data)
        assert known_returns.read(path, 9.81, steps) in ({}, returns)


def test_unwritable_cache_folder_is_no_error(
    tmp_path: Path, computed: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert (optimal_return(9.81, range(5)) < -9).all()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    (tmp_path / "keras_pendulum" / "gravity_9.81.npz").mkdir(parents=True)
    assert (optimal_return(9.81, range(5)) < -9).all()
    assert computed == [1000, 1000]


def test_a_user_without_a_home_gets_the_returns_too(
    computed: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_home(path: Path) -> Path:
        raise RuntimeError("Could not determine home directory.")

    known = optimal_return(1.0, range(5))
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(Path, "expanduser", no_home)
    np.testing.assert_array_equal(optimal_return(1.0, range(5)), known)
    first, second = (optimal_return(9.81, range(5)) for _ in range(2))
    np.testing.assert_array_equal(first, second)
    assert computed == [1000, 1000]  # there is no place to keep them


def test_command_writes_the_files_that_ship(
    tmp_path: Path, computed: list[int], capsys: pytest.CaptureFixture[str]
) -> None:
    assert optimum.main(["1", "9.81", "--out", str(tmp_path)]) == 0
    assert optimum.main(["9.81", "--steps", "60", "--out", str(tmp_path)]) == 0
    for gravity, steps in ((1.0, 200), (9.81, 200), (9.81, 60)):
        path = tmp_path / known_returns.file_name(gravity, steps)
        found = known_returns.read(path, gravity, steps)
        assert list(found) == list(range(10_000))
        assert max(found.values()) == pytest.approx(-gravity - 1 / steps, abs=0.003)
    assert run_command(lambda: optimum.main(["-3", "--out", str(tmp_path)])) == 2
    assert run_command(lambda: optimum.main(["1", "--steps", "0", "--out", str(tmp_path)])) == 2
    assert computed == [10_000] * 3
    assert run_command(lambda: optimum.main(["1", "--out", str(tmp_path / "none")])) == 2
    assert "Traceback" not in capsys.readouterr().err


def test_importing_is_light() -> None:
    code = "import keras_pendulum.optimum, sys; print({'gymnasium', 'tensorflow'} & {*sys.modules})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"
