"""The progress of a run as lines, where the output is no terminal."""

from __future__ import annotations

from typing import Any

import pytest

import keras_pendulum as kp
from keras_pendulum.history import EpisodeRecord
from keras_pendulum.train.progress import ProgressLines


def record(episode: int, **changes: Any) -> EpisodeRecord:
    value = -float(episode)
    return EpisodeRecord(
        episode, value / 200, value, 0.5, 0.1, 200 * (episode + 1), 0, 0.5
    )._replace(**changes)


def printed(
    episodes: range, optimum: float, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> list[str]:
    monkeypatch.setattr(
        "keras_pendulum.evaluate.evaluation.optimal_training_return", lambda config: optimum
    )
    show = ProgressLines(kp.preset("reference"))
    for episode in episodes:
        show(record(episode))
    lines: list[str] = capsys.readouterr().out.splitlines()
    return lines


def test_every_50_episodes_have_a_line_with_the_regret_of_the_last_10(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = printed(range(110), -4.5, monkeypatch, capsys)
    assert [line for line in lines if line.startswith("Episode: ")] == [
        record(episode).line() for episode in range(110)
    ]
    assert lines[49:52] == [
        record(49).line(),
        "Mean of episodes 40 to 49, random actions included: return -44.50, regret 40.00",
        record(50).line(),
    ]
    assert lines[101] == (
        "Mean of episodes 90 to 99, random actions included: return -94.50, regret 90.00"
    )
    assert len(lines) == 112


def test_resumed_run_names_the_episodes_of_its_mean(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = printed(range(47, 51), -4.0, monkeypatch, capsys)
    assert lines[3] == (
        "Mean of episodes 47 to 49, random actions included: return -48.00, regret 44.00"
    )


def test_line_has_no_regret_without_a_known_optimum(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = printed(range(50), float("nan"), monkeypatch, capsys)
    assert lines[-1] == "Mean of episodes 40 to 49, random actions included: return -44.50"


def test_evaluation_has_a_line_after_that_of_its_episode(
    capsys: pytest.CaptureFixture[str],
) -> None:
    ProgressLines(kp.preset("reference"))(record(5, greedy_regret=1.2345))
    assert capsys.readouterr().out.splitlines() == [
        record(5).line(),
        "Greedy policy after episode 5: regret 1.23",
    ]
