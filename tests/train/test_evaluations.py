"""Evaluations during a run: they change nothing in it, and the best weights are kept."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import Command
from short_runs import SHORT, KilledError, assert_same_state, kill_at_call

import keras_pendulum as kp
from keras_pendulum.config.config import Config
from keras_pendulum.environments.pendulum import Pendulum
from keras_pendulum.history import EpisodeRecord
from keras_pendulum.optimum.solution import USUAL_SEEDS
from keras_pendulum.storage.run_folder import find_run
from keras_pendulum.train import evaluations, folder_files
from keras_pendulum.train.checkpoint import load_checkpoint
from keras_pendulum.train.run import Run

SEEDS = evaluations.SEEDS  # before the fixture below changes them
FEW_STARTS = range(900, 903)
Regrets = Callable[..., list[list[Any]]]
pytestmark = pytest.mark.usefixtures("few_starts")


@pytest.fixture(scope="module")
def few_starts(short_ending: None) -> Iterator[None]:
    """Evaluates on few starts and draws nothing."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(evaluations, "SEEDS", FEW_STARTS)
        yield


@pytest.fixture
def regrets(monkeypatch: pytest.MonkeyPatch) -> Regrets:
    """Replaces the regrets of the next evaluations; returns the list of their weights."""

    def replace_by(*values: float) -> list[list[Any]]:
        weights: list[list[Any]] = []
        remaining = iter(values)

        def evaluate(network: kp.DQN, episodes: int, seed: int) -> kp.Score:
            weights.append(network.get_weights())
            return kp.Score(Pendulum(), np.array([-next(remaining)]), np.zeros(1))

        monkeypatch.setattr(evaluations, "evaluate_policy", evaluate)
        return weights

    return replace_by


def evaluated(history: list[EpisodeRecord]) -> dict[int, float]:
    """Returns the regrets of the evaluations, by episode."""
    return {
        record.episode: record.greedy_regret
        for record in history
        if not math.isnan(record.greedy_regret)
    }


def assert_weights(path: Path, expected: list[Any]) -> None:
    np.testing.assert_equal(kp.load_weights(path).get_weights(), expected)


def test_starts_are_not_those_of_the_results_and_their_optimum_is_never_computed_alone() -> None:
    seeds = SEEDS
    assert not set(seeds) & set(range(100))
    assert set(seeds) <= set(USUAL_SEEDS)
    text = Config.__dataclass_fields__["evaluate_every"].metadata["help"]
    assert f"the {len(seeds)} starts of seeds {seeds.start} to {seeds[-1]}" in text


@pytest.mark.parametrize("name", ["reference", "cartpole-original"])
def test_evaluated_run_equals_a_run_without_evaluations_bit_for_bit(
    name: str, tmp_path: Path
) -> None:
    plain = kp.preset(name, episodes=8, hidden_units=(8,))
    if plain.train_frequency == "episode":
        plain = plain.change(**SHORT)
    config = replace(plain, evaluate_every=3, keep_best=True)
    runs: list[Run] = []
    for settings, folder in ((plain, tmp_path / "plain"), (config, tmp_path / "evaluated")):
        kp.train_dqn(settings, folder)
        runs.append(load_checkpoint(find_run(folder).weights, settings))
    without, with_evaluations = runs
    assert list(evaluated(with_evaluations.history)) == [2, 5]
    assert without.history[-1].updates > 0
    with_evaluations.history = [
        record._replace(greedy_regret=math.nan) for record in with_evaluations.history
    ]
    assert_same_state(with_evaluations, without)


def test_regret_is_that_of_evaluate_policy_on_the_same_starts() -> None:
    result = kp.train_dqn(kp.preset("cartpole", episodes=4, evaluate_every=2, **SHORT))
    score = kp.evaluate_policy(result.network, len(FEW_STARTS), FEW_STARTS.start)
    assert list(evaluated(result.history)) == [1, 3]
    assert result.history[3].greedy_regret == score.regret


def rows_of(folder: Path) -> list[dict[str, str]]:
    with open(folder / "history.csv", encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_history_has_the_regrets_of_evaluated_runs_only(tmp_path: Path) -> None:
    config = kp.preset("original", episodes=3, **SHORT)
    kp.train_dqn(config, tmp_path)
    assert "greedy_regret" not in rows_of(tmp_path)[0]
    longer = replace(config, episodes=6, evaluate_every=2)
    result = kp.train_dqn(longer, tmp_path, resume=True)
    rows = rows_of(tmp_path)
    assert list(rows[0])[-2:] == ["seconds", "greedy_regret"]
    regrets = {int(row["episode"]): row["greedy_regret"] for row in rows if row["greedy_regret"]}
    assert regrets == {i: repr(regret) for i, regret in evaluated(result.history).items()}
    assert list(regrets) == [3, 5]
    # The column stays when the run is no longer evaluated.
    kp.train_dqn(replace(config, episodes=7), tmp_path, resume=True)
    assert [row["greedy_regret"] != "" for row in rows_of(tmp_path)] == [
        *(False, False, False, True, False, True, False)
    ]


def test_best_weights_are_kept_beside_the_last(tmp_path: Path, regrets: Regrets) -> None:
    weights = regrets(9.0, 5.0, 7.0, 5.0, 6.0)
    config = kp.preset("reference", episodes=5, evaluate_every=1, keep_best=True, **SHORT)
    result = kp.train_dqn(config, tmp_path)
    best = tmp_path / "pendulum_weight_best.h5"
    assert_weights(best, weights[3])  # the later of two equals
    assert_weights(tmp_path / "pendulum_weight.h5", result.network.get_weights())
    assert any((one != two).any() for one, two in zip(weights[3], weights[4], strict=True))
    assert kp.load_weights(best).metadata == result.network.metadata
    with pytest.raises(kp.WeightsError, match="weights without a run"):
        load_checkpoint(best, config)


def test_run_killed_before_its_best_weights_are_written_writes_them_when_resumed(
    tmp_path: Path, regrets: Regrets, monkeypatch: pytest.MonkeyPatch
) -> None:
    weights = regrets(9.0, 5.0, 7.0, 6.0)
    config = kp.preset("reference", episodes=3, evaluate_every=1, keep_best=True, **SHORT)
    with monkeypatch.context() as patched:
        # Of the second best weights, after their checkpoint.
        kill_at_call(folder_files, "encode_weights", 2, patched)
        with pytest.raises(KilledError):
            kp.train_dqn(config, tmp_path)
    assert_weights(tmp_path / "pendulum_weight_best.h5", weights[0])
    kp.train_dqn(config, tmp_path, resume=True)
    assert len(weights) == 3  # episode 1 was not evaluated again
    assert_weights(tmp_path / "pendulum_weight_best.h5", weights[1])
    # A resumed run knows the regret of its best weights.
    kp.train_dqn(replace(config, episodes=4), tmp_path, resume=True)
    assert_weights(tmp_path / "pendulum_weight_best.h5", weights[1])


def test_run_that_asks_later_for_its_best_weights_begins_with_its_last_evaluation(
    tmp_path: Path, regrets: Regrets
) -> None:
    weights = regrets(1.0, 3.0, 4.0, 2.0)
    config = kp.preset("reference", episodes=2, evaluate_every=1, **SHORT)
    kp.train_dqn(config, tmp_path)
    best = tmp_path / "pendulum_weight_best.h5"
    assert not best.exists()
    # The weights of the regret 1 are lost; the checkpoint holds those of 3.
    kp.train_dqn(replace(config, episodes=3, keep_best=True), tmp_path, resume=True)
    assert_weights(best, weights[1])
    kp.train_dqn(replace(config, episodes=4, keep_best=True), tmp_path, resume=True)
    assert_weights(best, weights[3])


def test_phases_are_announced_before_they_begin(tmp_path: Path) -> None:
    events: list[object] = []
    config = kp.preset("reference", episodes=5, evaluate_every=2, **SHORT)
    kp.train_dqn(
        config,
        tmp_path,
        listeners=[lambda record: events.append(record.episode)],
        on_phase=events.append,
    )
    training = [0, "evaluating", 1, "compiling", 2, "evaluating", 3, 4]
    assert events == [*training, "evaluating", "drawing"]
    events.clear()
    kp.train_dqn(replace(config, episodes=6), tmp_path, resume=True, on_phase=events.append)
    assert events == ["compiling", "evaluating", "evaluating", "drawing"]


def test_command_resumes_a_run_with_other_evaluations(in_process: Command, tmp_path: Path) -> None:
    words = ["--preset", "original", "--hidden-units", "8", "--out", "run", "--quiet"]
    done = in_process("train", *words, "--episodes", "2", "--evaluate-every", "1")
    assert done.returncode == 0, done.stderr
    # The checkpoint's settings count: first its episodes, then its evaluate_every.
    resumed = ["--resume", "--out", "run"]
    long = str(kp.preset("reference").episodes + 1)
    done = in_process("train", *resumed, "--evaluate-every", long)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(
        f"error: evaluate_every {long} is larger than the run's 2 episodes"
    )
    done = in_process("train", *resumed, "--episodes", "3", "--keep-best")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "run" / "pendulum_weight_best.h5").exists()
    assert [row["greedy_regret"] != "" for row in rows_of(tmp_path / "run")] == [True] * 3
