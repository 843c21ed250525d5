"""One run of a study and its result."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest

from keras_pendulum.config.presets import preset
from keras_pendulum.errors import UserError
from keras_pendulum.evaluate.evaluation import evaluate_policy
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
PENDULUM_RESULT = RunResult(-40.0, [-41.5] * 100, [-1.0] * 2, [-100.0] * 2, [1.5] * 5)
POLE = Job("pole", "pole", preset("cartpole", episodes=11), {})
POLE_RESULT = RunResult(500.0, [499.0] * 100, [1.0] * 2, [20.0] * 2, [1.0] * 5)


@pytest.mark.parametrize(
    ("job", "field", "count", "low", "high"),
    [
        (PENDULUM, "optimal_mean_return", 1, 200 * LOWEST, 0.0),
        (PENDULUM, "returns", 100, 200 * LOWEST, 0.0),
        (PENDULUM, "average_rewards", 2, LOWEST, 0.0),
        (PENDULUM, "episode_returns", 2, 100 * LOWEST, 0.0),
        (PENDULUM, "greedy_regrets", 5, 200 * LOWEST, -200 * LOWEST),
        (POLE, "returns", 100, 0.0, 500.0),
        (POLE, "average_rewards", 2, 0.0, 1.0),
        (POLE, "episode_returns", 2, 0.0, 500.0),
    ],
)
def test_numbers_that_no_run_can_have_are_refused_despite_their_checksum(
    job: Job, field: str, count: int, low: float, high: float
) -> None:
    def is_valid(numbers: list[Any]) -> bool:
        change: dict[str, Any] = {field: numbers[0] if field == "optimal_mean_return" else numbers}
        result = (PENDULUM_RESULT if job is PENDULUM else POLE_RESULT)._replace(**change)
        return decode(encode(job, result), job) == result

    assert is_valid([low] * count)
    assert is_valid([high] * count)
    for wrong in (low - 0.001, high + 0.001, math.nan, -math.inf, False):
        assert not is_valid([wrong] + [low] * (count - 1))
    if field in ("average_rewards", "episode_returns", "greedy_regrets"):
        for numbers in ([None] * count, ["1"] * count, []):
            assert not is_valid(numbers)
    if count > 1:
        assert not is_valid([low] * (count - 1))
        assert not is_valid([low] * (count + 1))


@pytest.mark.parametrize(
    ("changes", "valid"),
    [
        ({}, True),
        ({"returns": []}, False),
        ({"optimal_mean_return": "−40"}, False),
        ({"regret": 1.0}, False),
        ({"regret": None}, False),
        ({"seed": 1}, False),
        ({"more": 1}, False),
        # Older versions also record settings that have no effect.
        ({"config": {**PENDULUM.config.learning(), "save_every": 7, "target_period": 5}}, True),
        ({"config": {**PENDULUM.config.learning(), "discount": 0.5}}, False),
    ],
    ids=str,
)
def test_result_with_another_content_is_refused_despite_its_checksum(
    changes: dict[str, Any], valid: bool
) -> None:
    content = json.loads(encode(PENDULUM, PENDULUM_RESULT))["result"] | changes
    found = decode(job_module._with_checksum(content), PENDULUM)
    assert found == (PENDULUM_RESULT if valid else None)


def test_result_with_a_changed_digit_is_refused() -> None:
    data = encode(PENDULUM, PENDULUM_RESULT)
    changed = data.replace(b"-100.0", b"-101.0", 1)
    assert changed != data
    assert decode(changed, PENDULUM) is None


def test_result_has_the_settings_of_the_learning_only() -> None:
    settings = json.loads(encode(PENDULUM, PENDULUM_RESULT))["result"]["config"]
    assert settings.keys() == PENDULUM.config.learning().keys() - {"seed"}


def test_run_is_that_of_train_dqn_with_its_evaluations(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(job_module, "use_one_thread", lambda: None)
    monkeypatch.setattr(job_module, "_EVALUATIONS", 2)
    job = Job("arm", "arm", preset("original", hidden_units=(8,), episodes=5), installed_versions())
    reply = train_and_score(job)
    result = decode(reply.result, job)
    assert result is not None
    trained = train_dqn(preset("original", hidden_units=(8,), episodes=5, evaluate_every=3))
    assert result.greedy_regrets == [round(trained.history[2].greedy_regret, 6)]
    assert result.returns == evaluate_policy(trained.network).returns.tolist()
    returns = [record.episode_return for record in trained.history]
    assert result.episode_returns == curve_points(returns)
    assert reply.evaluation > 0
    assert reply.training > 0


@pytest.mark.parametrize(
    ("episodes", "every"), [(1, 1), (10, 1), (11, 2), (500, 50), (1700, 170), (800, 80)]
)
def test_run_is_evaluated_at_most_10_times(episodes: int, every: int) -> None:
    assert evaluate_every(preset("reference", episodes=episodes)) == every
    assert episodes // every <= 10
