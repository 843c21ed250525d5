"""The benchmark that writes the files in keras_pendulum/optimum/data."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.learning import shipped_optima
from keras_pendulum.optimum import episode_values
from keras_pendulum.optimum.cartpole_values import file_name, pack
from keras_pendulum.optimum.episode_values import EpisodeValues
from keras_pendulum.optimum.stored_results import Problem, read_returns


def test_benchmark_writes_the_files_of_the_package(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fast_returns(problem: Problem, starts: NDArray[Any]) -> NDArray[Any]:
        return np.asarray(-np.dot(problem, (1, 0.001, 1)) - np.abs(starts[:, 0]))

    def fast_table(discount: float) -> NDArray[Any]:
        return np.full((2, 3), discount, np.float32)

    def fast_values(gravity: float) -> EpisodeValues:
        return EpisodeValues(np.array([[1, 65535], [3, 0]], np.uint16), gravity)

    monkeypatch.setattr(episode_values, "solve_episode", fast_values)
    monkeypatch.setattr(shipped_optima, "compute_returns", fast_returns)
    monkeypatch.setattr(shipped_optima, "solve_cartpole", fast_table)
    shipped_optima.main(str(tmp_path))
    shipped = {path.name for path in shipped_optima.DATA.iterdir()}
    assert {path.name for path in tmp_path.iterdir()} == shipped
    for problem in shipped_optima.SHIPPED:
        returns = read_returns(tmp_path / problem.file_name, problem)
        assert (
            returns.keys() == read_returns(shipped_optima.DATA / problem.file_name, problem).keys()
        )
        assert max(returns.values()) == pytest.approx(-np.dot(problem, (1, 0.001, 1)), abs=0.01)
    for gravity in shipped_optima.GRAVITIES:
        with np.load(tmp_path / f"values_gravity_{gravity:g}.npz") as written:
            differences = written["high"].astype(int) * 256 + written["low"].astype(int)
            assert (np.cumsum(differences) % 65536).tolist() == [1, 65535, 3, 0]
            assert written["scale"] == gravity
    for discount in shipped_optima.CARTPOLE_DISCOUNTS:
        with np.load(tmp_path / file_name(discount)) as written:
            for name, array in pack(fast_table(discount)).items():
                assert written[name].tolist() == array.tolist()
