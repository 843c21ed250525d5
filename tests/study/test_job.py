"""One run of a study and its result."""

from __future__ import annotations

import pytest

from keras_pendulum.config.presets import preset
from keras_pendulum.errors import UserError
from keras_pendulum.study import job as job_module
from keras_pendulum.study.job import (
    Job,
    curve_points,
    decode,
    installed_versions,
    train_and_score,
)


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
