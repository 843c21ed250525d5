from __future__ import annotations

import io
import re
import sys

import pytest

import keras_pendulum as kp
from keras_pendulum.history import EpisodeRecord
from keras_pendulum.train.progress_bar import make_progress

STEPS = 50  # per episode, in 0.5 s


def record(episode: int) -> EpisodeRecord:
    episode_return = -float((episode + 1) ** 2)
    steps = STEPS * (episode + 1)
    return EpisodeRecord(
        episode, episode_return / STEPS, episode_return, 0.5, 0.1, steps, episode, 0.5
    )


def printed_figures(
    optimum: float, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> list[str]:
    """Returns the text beside the bar after each of the first 13 of 100 episodes."""
    monkeypatch.setattr("keras_pendulum.train.progress_bar._SECONDS_BETWEEN_DRAWINGS", 0.0)
    monkeypatch.setattr(
        "keras_pendulum.evaluate.evaluation.optimal_training_return", lambda config: optimum
    )
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "200")
    listener = make_progress(kp.preset("reference", episodes=100))
    for episode in range(13):
        listener(record(episode))
    lines = capsys.readouterr().out.split("\r")[1:]
    return [line.split(" ", 2)[2].rstrip() for line in lines]


def test_bar_shows_regret_and_speed_of_the_last_10_episodes(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = printed_figures(-4.0, monkeypatch, capsys)
    mean = sum(i**2 for i in range(4, 14)) / 10
    assert lines[-1] == (
        f"return -169 regret {mean - 4:.4g} ε 0.50 loss 0.1 {STEPS / 0.5:.0f} steps/s 0:44 left"
    )
    # The first record of a resumed run does not say how many steps were made before it.
    assert lines[0] == "return -1 regret -3 ε 0.50 loss 0.1 0:50 left"


def test_bar_shows_no_regret_without_a_known_optimum(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert "regret" not in "".join(printed_figures(float("nan"), monkeypatch, capsys))


class Terminal(io.TextIOWrapper):
    def isatty(self) -> bool:
        return True


def drawn(encoding: str, term: str, monkeypatch: pytest.MonkeyPatch) -> str:
    """Returns the output for 1 and 2 of 2 episodes on a terminal of 60 columns."""
    monkeypatch.setattr(
        "keras_pendulum.evaluate.evaluation.optimal_training_return", lambda config: -4.0
    )
    output = Terminal(io.BytesIO(), encoding=encoding, errors="replace", newline="")
    monkeypatch.setattr(sys, "stdout", output)
    monkeypatch.setattr("keras_pendulum.train.progress_bar._SECONDS_BETWEEN_DRAWINGS", 0.0)
    monkeypatch.setenv("TERM", term)
    monkeypatch.setenv("COLUMNS", "60")
    listener = make_progress(kp.preset("reference", episodes=2))
    for episode in range(2):
        listener(record(episode)._replace(seconds=3600.0 * (2 - episode)))
    output.flush()
    assert isinstance(output.buffer, io.BytesIO)
    return output.buffer.getvalue().decode(encoding)


def test_bar_needs_no_escape_codes(monkeypatch: pytest.MonkeyPatch) -> None:
    longer, shorter = drawn("utf-8", "xterm", monkeypatch).removesuffix("\n").split("\r")[1:]
    assert (longer + shorter).isprintable()
    assert len(longer) == len(shorter) == 59  # nothing of the longer line is left
    assert longer.startswith("1/2 ━━")


@pytest.mark.parametrize("encoding", ["cp1252", "cp437", "ascii"])
def test_bar_has_other_marks_where_the_code_page_lacks_them(
    encoding: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    before, after = drawn(encoding, "xterm", monkeypatch).split("\r")[1:]
    assert before.startswith("1/2 ##")
    assert re.fullmatch(r"#+-+", before.split()[1])
    assert re.fullmatch(r"#+", after.split()[1])


def test_dumb_terminal_gets_a_line_for_each_episode(monkeypatch: pytest.MonkeyPatch) -> None:
    assert drawn("utf-8", "dumb", monkeypatch) == "".join(
        f"{record(episode).line()}\n" for episode in range(2)
    )
