"""What a terminal shows of a run."""

from __future__ import annotations

import sys

import pytest

import keras_pendulum as kp
from keras_pendulum.episodes import EpisodeRecord
from keras_pendulum.progress import make_progress

STEPS = 50  # of each episode, in half a second


def record(episode: int) -> EpisodeRecord:
    total = -float((episode + 1) ** 2)
    steps = STEPS * (episode + 1)
    return EpisodeRecord(episode, total / STEPS, total, 0.5, 0.1, steps, episode, 0.5)


def shown(
    best: float, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> list[str]:
    """What the bar says after each of the first 13 episodes of a run of 100."""
    monkeypatch.setattr("keras_pendulum.progress._SECONDS_BETWEEN", 0.0)
    monkeypatch.setattr("keras_pendulum.evaluation.best_training_return", lambda config: best)
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    monkeypatch.setenv("COLUMNS", "200")
    show = make_progress(kp.preset("reference", episodes=100))
    for episode in range(13):
        show(record(episode))
    lines = capsys.readouterr().out.replace("\x1b[K", "").split("\r")[1:]
    return [line.split(" ", 2)[2] for line in lines]


def test_the_bar_tells_the_regret_and_the_speed_of_the_last_10_episodes(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = shown(-4.0, monkeypatch, capsys)
    mean = sum(i**2 for i in range(4, 14)) / 10
    assert lines[-1] == (
        f"return -169 regret {mean - 4:.4g} ε 0.50 loss 0.1 {STEPS / 0.5:.0f} steps/s 0:44 left"
    )
    # A resumed run's first one does not tell how many of its steps were made before.
    assert lines[0] == "return -1 regret -3 ε 0.50 loss 0.1 0:50 left"


def test_no_regret_is_told_where_the_best_return_is_not_known(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert "regret" not in "".join(shown(float("nan"), monkeypatch, capsys))
