from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from keras_pendulum.optimum import __main__ as optimum_command
from keras_pendulum.optimum import return_cache


def test_command_writes_the_files_of_the_package(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    starts_of_calls: list[int] = []

    def fast_return(gravity: float, starts: NDArray[Any], steps: int) -> NDArray[Any]:
        starts_of_calls.append(len(starts))
        return np.asarray(-gravity - np.abs(starts[:, 0]) - 1 / steps)

    monkeypatch.setattr("keras_pendulum.optimum.optimal_return.best_return", fast_return)
    assert optimum_command.main(["1", "9.81", "--out", str(tmp_path)]) == 0
    assert optimum_command.main(["9.81", "--steps", "60", "--out", str(tmp_path)]) == 0
    for gravity, steps in ((1.0, 200), (9.81, 200), (9.81, 60)):
        path = tmp_path / return_cache.file_name(gravity, steps)
        returns = return_cache.read(path, gravity, steps)
        assert list(returns) == list(range(10_000))
        assert max(returns.values()) == pytest.approx(-gravity - 1 / steps, abs=0.003)
    assert optimum_command.main(["-3", "--out", str(tmp_path)]) == 2
    assert optimum_command.main(["1", "--steps", "0", "--out", str(tmp_path)]) == 2
    assert starts_of_calls == [10_000] * 3
    with pytest.raises(SystemExit, match="2"):
        optimum_command.main(["1"])
    assert capsys.readouterr().err.endswith("the following arguments are required: --out\n")
    assert optimum_command.main(["1", "--out", str(tmp_path / "missing")]) == 2
    error = capsys.readouterr().err
    assert error.startswith("error: cannot write ")
    assert error.count("\n") == 1


@pytest.mark.parametrize(
    ("module", "heavy"),
    [
        ("optimum.__main__", {"tensorflow", "keras", "gymnasium", "matplotlib", "numpy"}),
        ("optimum.optimal_return", {"tensorflow", "keras", "gymnasium", "matplotlib"}),
    ],
)
def test_import_is_light(module: str, heavy: set[str]) -> None:
    code = f"import keras_pendulum.{module}, sys; print({heavy} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"


def test_help_is_printed_without_numpy() -> None:
    code = (
        "import runpy, sys\n"
        "sys.argv = ['optimum', '--help']\n"
        "try:\n"
        "    runpy.run_module('keras_pendulum.optimum', run_name='__main__')\n"
        "except SystemExit as exit:\n"
        "    assert exit.code == 0\n"
        "assert not {'tensorflow', 'numpy'} & set(sys.modules)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("usage: python -m keras_pendulum.optimum")


def test_command_writes_the_returns_of_a_discount(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fast_return(
        gravity: float, discount: float, starts: NDArray[Any], steps: int
    ) -> NDArray[Any]:
        return np.asarray(-gravity - discount - np.abs(starts[:, 0]) - 1 / steps)

    monkeypatch.setattr("keras_pendulum.optimum.discounted.simulate_discounted", fast_return)
    words = ["1", "--discount", "0.9", "--out", str(tmp_path)]
    assert optimum_command.main(words) == 0
    path = tmp_path / "gravity_1_discount_0.9.npz"
    returns = return_cache.read(path, 1.0, 200, 0.9)
    assert list(returns) == list(range(1000))
    assert max(returns.values()) == pytest.approx(-1.905, abs=0.005)
    assert return_cache.read(path, 1.0, 200, 0.8) == return_cache.read(path, 1.0, 200) == {}
    assert optimum_command.main(["1", "--discount", "1.5", "--out", str(tmp_path)]) == 2
    assert optimum_command.main([*words, "--steps", "60"]) == 0
    path = tmp_path / "gravity_1_steps_60_discount_0.9.npz"
    returns = return_cache.read(path, 1.0, 60, 0.9)
    assert max(returns.values()) == pytest.approx(-1.9 - 1 / 60, abs=0.005)
    assert capsys.readouterr().err.splitlines() == [
        "error: discount is 1.5; expected a number from 0 to 1",
    ]
