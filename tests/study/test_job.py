"""One run of a study and its result."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest

from keras_pendulum.config.presets import preset
from keras_pendulum.errors import UserError
from keras_pendulum.study import job as job_module
from keras_pendulum.study.job import (
    Job,
    RunResult,
    curve_points,
    decode,
    encode,
    evaluate_every,
    installed_versions,
    train_and_score,
)
from keras_pendulum.train.train_dqn import train_dqn


def test_cartpole_regret_is_the_difference_to_500_and_a_run_uses_one_thread(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    calls = []
    monkeypatch.setattr(job_module, "use_one_thread", lambda: calls.append("one thread"))
    config = preset("cartpole", hidden_units=(8,), episodes=1)
    job = Job("pole", "pole", config, installed_versions())
    result = decode(train_and_score(job).result, job)
    assert result is not None
    assert result.optimal_mean_return == 500
    assert 0 < result.regret == 500 - sum(result.returns) / 100 < 500
    assert calls == ["one thread"]


def test_worker_with_other_versions_refuses_the_run() -> None:
    job = Job("arm", "arm", preset("reference"), {**installed_versions(), "keras": "2.0"})
    with pytest.raises(
        UserError, match=r"the worker .* has keras .*, this study has 2\.0: use the same"
    ):
        train_and_score(job)


def test_curve_points_are_means_of_ten_episodes_and_of_the_rest() -> None:
    assert curve_points([*range(20), 7.0, 8.0]) == [4.5, 14.5, 7.5]


LOWEST = -(math.pi**2 + 6.4 + 0.004)  # reward of a step
PENDULUM = Job("arm", "arm", preset("reference", episodes=11, max_episode_steps=100), {})
POLE = Job("pole", "pole", preset("cartpole", episodes=11), {})
PENDULUM_RESULT = RunResult(-40.0, [-41.5] * 100, [-1.0] * 2, [-100.0] * 2)
POLE_RESULT = RunResult(500.0, [499.0] * 100, [1.0] * 2, [20.0] * 2)


@pytest.mark.parametrize(
    "changes",
    [
        {"optimal_mean_return": 0.0, "returns": [200 * LOWEST] * 100},
        {"optimal_mean_return": 200 * LOWEST, "returns": [0.0] * 100},
        {"average_rewards": [LOWEST, 0.0], "episode_returns": [100 * LOWEST, 0.0]},
    ],
)
def test_numbers_at_the_limits_are_valid(changes: dict[str, Any]) -> None:
    result = PENDULUM_RESULT._replace(**changes)
    assert decode(encode(PENDULUM, result), PENDULUM) == result


def test_run_has_a_greedy_regret_for_each_evaluation(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(job_module, "use_one_thread", lambda: None)
    monkeypatch.setattr(job_module, "_EVALUATIONS", 2)
    job = Job("arm", "arm", preset("original", hidden_units=(8,), episodes=5), installed_versions())
    reply = train_and_score(job)
    result = decode(reply.result, job)
    assert result is not None
    trained = train_dqn(preset("original", hidden_units=(8,), episodes=5, evaluate_every=3))
    assert result.greedy_regrets == [round(trained.history[2].greedy_regret, 6)]
    assert reply.evaluation > 0
    assert reply.training > 0


@pytest.mark.parametrize(
    ("episodes", "every"), [(1, 1), (10, 1), (11, 2), (500, 50), (1700, 170), (800, 80)]
)
def test_run_is_evaluated_at_most_10_times(episodes: int, every: int) -> None:
    assert evaluate_every(preset("reference", episodes=episodes)) == every
    assert episodes // every <= 10


@pytest.mark.parametrize(
    ("regrets", "valid"),
    [
        ([], True),  # a result of an older version
        ([0.5] * 5, True),
        ([-0.5, *[1000.0] * 4], True),
        ([0.5] * 4, False),
        ([math.nan] * 5, False),
        ([-300 * LOWEST] * 5, False),
        (["1"] * 5, False),
    ],
)
def test_result_is_valid_with_all_its_greedy_regrets_or_none(
    regrets: list[Any], valid: bool
) -> None:
    result = PENDULUM_RESULT._replace(greedy_regrets=regrets)
    assert (decode(encode(PENDULUM, result), PENDULUM) == result) == valid


def test_result_of_an_older_version_is_read() -> None:
    content = json.loads(encode(PENDULUM, PENDULUM_RESULT))["result"]
    del content["greedy_regrets"]
    assert decode(job_module._with_checksum(content), PENDULUM) == PENDULUM_RESULT


def test_result_has_no_settings_of_evaluations_during_the_run() -> None:
    # So the results of studies from before these settings are still valid.
    settings = json.loads(encode(PENDULUM, PENDULUM_RESULT))["result"]["config"]
    assert "save_every" in settings
    assert not {"evaluate_every", "keep_best", "snapshots"} & set(settings)


def test_cartpole_results_at_the_limits_are_valid() -> None:
    result = RunResult(500.0, [500.0] * 99 + [0.0], [1.0] * 2, [500.0, 0.0])
    assert decode(encode(POLE, result), POLE) == result


@pytest.mark.parametrize(
    "changes",
    [
        {"optimal_mean_return": 0.001},
        {"optimal_mean_return": 200 * LOWEST - 0.001},
        {"optimal_mean_return": math.nan},
        {"optimal_mean_return": "−40"},
        {"returns": [-41.5] * 99},
        {"returns": [-41.5] * 101},
        {"returns": [-41.5] * 99 + [0.001]},
        {"returns": [-41.5] * 99 + [200 * LOWEST - 0.001]},
        {"returns": [-41.5] * 99 + [math.nan]},
        {"returns": [-41.5] * 99 + [-math.inf]},
        {"returns": [-41.5] * 99 + [False]},
        {"average_rewards": [-1.0]},
        {"average_rewards": [-1.0, LOWEST - 0.001]},
        {"average_rewards": [-1.0, 0.001]},
        {"average_rewards": [-1.0, None]},
        {"episode_returns": [-1.0] * 3},
        {"episode_returns": [-1.0, 100 * LOWEST - 0.001]},
        {"episode_returns": [-1.0, 0.001]},
    ],
    ids=str,
)
def test_numbers_that_no_run_can_have_are_refused_despite_their_checksum(
    changes: dict[str, Any],
) -> None:
    assert decode(encode(PENDULUM, PENDULUM_RESULT), PENDULUM) == PENDULUM_RESULT
    content = {
        **job_module._settings(PENDULUM),
        **PENDULUM_RESULT._asdict(),
        "regret": PENDULUM_RESULT.regret,
        **changes,
    }
    if isinstance(content["optimal_mean_return"], float) and None not in content["returns"]:
        regret = content["optimal_mean_return"] - sum(content["returns"]) / len(content["returns"])
        content["regret"] = regret
    assert decode(job_module._with_checksum(content), PENDULUM) is None


@pytest.mark.parametrize(
    "changes",
    [
        {"returns": [499.0] * 99 + [500.001]},
        {"returns": [499.0] * 99 + [-0.001]},
        {"average_rewards": [1.0, 1.001]},
        {"episode_returns": [20.0, 500.001]},
    ],
    ids=str,
)
def test_cartpole_results_beyond_the_limits_are_refused(changes: dict[str, Any]) -> None:
    assert decode(encode(POLE, POLE_RESULT), POLE) == POLE_RESULT
    assert decode(encode(POLE, POLE_RESULT._replace(**changes)), POLE) is None


@pytest.mark.parametrize("changes", [{"returns": []}, {"regret": 1.0}, {"regret": None}], ids=str)
def test_result_without_returns_or_with_another_regret_is_refused(changes: dict[str, Any]) -> None:
    content = {
        **job_module._settings(PENDULUM),
        **PENDULUM_RESULT._asdict(),
        "regret": PENDULUM_RESULT.regret,
    }
    assert decode(job_module._with_checksum(content), PENDULUM) == PENDULUM_RESULT
    assert decode(job_module._with_checksum({**content, **changes}), PENDULUM) is None
