"""Tables of values in files: computed once, and again where a file cannot be right."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import keras_pendulum as kp
from keras_pendulum.optimum import discounted
from keras_pendulum.optimum import episode_values as module
from keras_pendulum.optimum.cartpole_values import cartpole_value
from keras_pendulum.optimum.discounted import discounted_value
from keras_pendulum.optimum.episode_values import COLUMNS, EpisodeValues, episode_values
from keras_pendulum.optimum.episode_values import solve_episode as solve_finely
from keras_pendulum.optimum.stored_results import read_arrays, write_arrays

pytestmark = pytest.mark.quick


def roots_of_an_episode() -> Any:
    values = episode_values(3.5)
    return values.roots * values.scale


# A table, its file, and what is said when it is computed.
TABLES: dict[str, tuple[Callable[[], Any], str, str]] = {
    "CartPole": (lambda: cartpole_value(0.1), "cartpole_discount_0.1.npz", "γ = 0.1"),
    "pendulum": (
        lambda: discounted_value(1, 0.1),
        "value_gravity_1_discount_0.1.npz",
        "g = 1 and γ = 0.1",
    ),
    "episode": (roots_of_an_episode, "values_gravity_3.5.npz", "g = 3.5"),
}


@pytest.fixture(autouse=True)
def coarse_episodes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Computes the values of episodes on a coarse grid, in a table of the right shape."""

    def solve_coarsely(gravity: float) -> EpisodeValues:
        few = solve_finely(gravity, 11)
        return EpisodeValues(few.roots[:, np.arange(COLUMNS) * 10 // (COLUMNS - 1)], few.scale)

    monkeypatch.setattr(module, "solve_episode", solve_coarsely)


def require_equal(name: str, table: Any, right: Any) -> None:
    # The file of CartPole has float16.
    np.testing.assert_allclose(table, right, rtol=0, atol=1e-3 if name == "CartPole" else 0)


@pytest.mark.parametrize("name", TABLES)
def test_table_is_computed_once_and_read_from_the_cache(
    name: str, optimum_cache: Path, caplog: pytest.LogCaptureFixture
) -> None:
    table, file, said = TABLES[name]
    first = table()
    require_equal(name, table(), first)
    assert len(caplog.records) == 1 and said in caplog.text
    assert [path.name for path in optimum_cache.iterdir()] == [file]


@pytest.mark.parametrize(
    ("name", "damage"),
    [
        ("CartPole", lambda arrays: {"high": arrays["high"][:-1]}),
        ("CartPole", lambda arrays: {"low": arrays["low"].astype(np.float32)}),
        ("CartPole", lambda arrays: {"low": None}),
        ("CartPole", lambda arrays: {"high": np.full_like(arrays["high"], 0x7E)}),  # NaN
        ("CartPole", lambda arrays: {"high": np.full_like(arrays["high"], 0x70)}),  # 8192
        ("pendulum", lambda arrays: {"value": arrays["value"][:, :-1]}),
        ("pendulum", lambda arrays: {"value": -arrays["value"]}),
        ("pendulum", lambda arrays: {"value": arrays["value"].astype(np.float64)}),
        ("pendulum", lambda arrays: {"value": np.full_like(arrays["value"], np.nan)}),
        ("pendulum", lambda arrays: {"gravity": np.array(2.0)}),
        ("episode", lambda arrays: {"high": arrays["high"][:-1]}),
        ("episode", lambda arrays: {"low": arrays["low"].astype(np.float32)}),
        ("episode", lambda arrays: {"scale": None}),
        ("episode", lambda arrays: {"scale": np.nan}),
        ("episode", lambda arrays: {"scale": 0.0}),
        ("episode", lambda arrays: {"scale": 1.0}),
        ("episode", lambda arrays: {"scale": np.array([0.0001])}),
    ],
)
def test_table_that_cannot_be_right_is_computed_again(
    name: str, damage: Any, optimum_cache: Path, caplog: pytest.LogCaptureFixture
) -> None:
    table, file, _ = TABLES[name]
    right = table()
    arrays = read_arrays(optimum_cache / file)
    arrays |= damage(arrays)
    write_arrays(
        optimum_cache / file, {key: each for key, each in arrays.items() if each is not None}
    )
    for _ in range(2):
        require_equal(name, table(), right)
    assert len(caplog.records) == 2


def test_table_is_that_of_its_gravity_and_discount(
    optimum_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    solved = []

    def solve(gravity: float, discount: float, cells: int) -> Any:
        solved.append((gravity, discount))
        return np.full((cells, 800), -gravity, np.float32)

    monkeypatch.setattr(discounted, "solve_discounted", solve)
    for gravity, discount in (2.0, 0.3), (3.0, 0.3), (3.0, 0.4):
        assert discounted_value(gravity, discount)[0, 0] == -gravity
    assert solved == [(2.0, 0.3), (3.0, 0.3), (3.0, 0.4)]


@pytest.mark.parametrize(
    ("compute", "problem"),
    [
        (lambda: cartpole_value(1.5), r"^discount is 1\.5; expected a number"),
        (lambda: discounted_value(1, 1.1), r"^discount is 1\.1; expected a number"),
        (lambda: episode_values(-1), r"^gravity is -1; expected a number"),
    ],
)
def test_number_out_of_range_has_no_table(compute: Callable[[], Any], problem: str) -> None:
    with pytest.raises(kp.ConfigError, match=problem):
        compute()
