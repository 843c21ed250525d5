"""A further task needs one class like those of `environments/` and one like those of `optimum/`."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import gymnasium
import numpy as np
import pytest
from numpy.typing import NDArray

import keras_pendulum as kp
from keras_pendulum.compare.__main__ import main as compare
from keras_pendulum.environments.actions import Actions
from keras_pendulum.environments.task import Task
from keras_pendulum.environments.tasks import TASKS
from keras_pendulum.evaluate.__main__ import main as evaluate
from keras_pendulum.optimum.solution import Solution
from keras_pendulum.optimum.solutions import SOLUTIONS
from keras_pendulum.train.__main__ import main as train

CELLS = 5


class CorridorEnv(gymnasium.Env[Any, Any]):
    """A corridor of five cells. Each step in the last cell has the reward 1."""

    observation_space = gymnasium.spaces.Box(0, CELLS - 1, (1,))
    action_space: Any = gymnasium.spaces.Discrete(2)  # left, right

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        super().reset(seed=seed)
        self.cell = int(self.np_random.integers(CELLS))
        return self._observe(), {}

    def step(self, action: int) -> Any:
        self.cell = min(max(self.cell + 2 * action - 1, 0), CELLS - 1)
        return self._observe(), float(self.cell == CELLS - 1), False, False, {}

    def _observe(self) -> NDArray[np.float32]:
        return np.array([self.cell], np.float32)


@dataclass(frozen=True)
class Corridor(Task):
    environment: ClassVar[str] = "Corridor-v0"
    observation_names: ClassVar[tuple[str, ...]] = ("cell",)
    steps_per_episode: ClassVar[int] = 8
    never_terminates: ClassVar[bool] = True
    reward_range: ClassVar[tuple[float, float]] = (0.0, 1.0)
    seconds_per_step: ClassVar[float] = 0.1
    weights_name: ClassVar[str] = "corridor_weight.h5"

    def actions(self, count: int | None = None, **options: Any) -> Actions:
        return Actions(np.arange(2))


class CorridorSolution(Solution):
    def best_returns(self, seeds: Iterable[int], steps: int | None = None) -> NDArray[np.float64]:
        env: Any = self.task.make_env().unwrapped
        returns = []
        for seed in seeds:
            env.reset(seed=seed)
            returns.append((steps or 8) - max(0, CELLS - 2 - env.cell))
        return np.array(returns, np.float64)


@pytest.fixture(autouse=True)
def corridor(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setitem(TASKS, "Corridor-v0", Corridor)
    monkeypatch.setitem(SOLUTIONS, "Corridor-v0", CorridorSolution)
    gymnasium.register("Corridor-v0", lambda **_: CorridorEnv())
    yield
    del gymnasium.registry["Corridor-v0"]


@pytest.mark.slow
def test_third_task_is_trained_evaluated_resumed_and_compared(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    words = ["--preset", "reference", "--environment", "Corridor-v0", "--hidden-units", "16"]
    words += ["--warmup-episodes", "4", "--max-episode-steps", "8", "--seed", "1"]
    assert train([*words, "--episodes", "20", "--out", "runs/one"]) == 0
    assert train(["--resume", "--episodes", "40", "--out", "runs/one"]) == 0
    assert train([*words, "--episodes", "40", "--out", "runs/two"]) == 0
    for run in ("one", "two"):
        names = {file.name for file in (tmp_path / "runs" / run).iterdir()}
        assert names == {"corridor_weight.h5", "history.csv", "config.json", "rewards.png"}
    one, two = (kp.load_weights(f"runs/{run}/corridor_weight.h5") for run in ("one", "two"))
    assert kp.evaluate_policy(two, 10).regret == 0

    capsys.readouterr()
    assert evaluate(["runs/two/corridor_weight.h5"]) == 0
    assert capsys.readouterr().out.startswith("Greedy on 100 fixed starts, Corridor-v0: mean ")
    assert compare(["runs/one", "runs/two"]) == 0
    assert "Corridor-v0: best possible mean return" in capsys.readouterr().out
    assert (tmp_path / "comparison.png").exists()
    assert kp.load_policy(one).task == Corridor()
    assert kp.load_policy(one)([0.0]) in (0, 1)


def test_third_task_has_random_returns() -> None:
    solution = CorridorSolution(Corridor())
    assert 0 < solution.random_return() < solution.mean_best_return(8) < 8
