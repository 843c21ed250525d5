"""The progress of a run: its lines, its bar, and the terminals that the bar fits."""

from __future__ import annotations

import io
import re
import sys
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

import keras_pendulum as kp
from keras_pendulum.history import EpisodeRecord
from keras_pendulum.train.progress import make_progress

STEPS = 50  # per episode, in 0.5 s


def record(episode: int, **changes: Any) -> EpisodeRecord:
    episode_return = -float((episode + 1) ** 2)
    steps = STEPS * (episode + 1)
    one = EpisodeRecord(
        episode, episode_return / STEPS, episode_return, 0.5, 0.1, steps, episode, 0.5
    )
    return one._replace(**changes)


class Terminal(io.TextIOWrapper):
    def isatty(self) -> bool:
        return True

    def text(self) -> str:
        """Returns all that was printed."""
        self.flush()
        assert isinstance(self.buffer, io.BytesIO)
        return self.buffer.getvalue().decode(self.encoding)

    def lines(self) -> list[str]:
        """Returns each line that was drawn, without the spaces at its end."""
        return [line.rstrip() for line in self.text().split("\r")[1:]]


MakeTerminal = Callable[..., Terminal]


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> MakeTerminal:
    """Returns a function that makes the output a terminal whose bar is drawn at each episode."""

    def make(columns: int = 200, encoding: str = "utf-8", term: str = "xterm") -> Terminal:
        output = Terminal(io.BytesIO(), encoding=encoding, errors="replace", newline="")
        monkeypatch.setattr(sys, "stdout", output)
        monkeypatch.setattr("keras_pendulum.train.progress._SECONDS_BETWEEN_DRAWINGS", 0.0)
        monkeypatch.setenv("TERM", term)
        monkeypatch.setenv("COLUMNS", str(columns))
        return output

    return make


@pytest.mark.parametrize(
    ("episodes", "means"),
    [
        (range(110), ["40 to 49, -44.50", "90 to 99, -94.50"]),
        (range(47, 51), ["47 to 49, -48.00"]),  # a resumed run
    ],
)
def test_every_50_episodes_have_a_line_with_the_return_of_the_last_10(
    episodes: range, means: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    progress = make_progress(kp.preset("reference"))  # the output is not a terminal
    expected = []
    for episode in episodes:
        progress.on_episode(record(episode, episode_return=-float(episode)))
        expected.append(record(episode).line())
        if episode % 50 == 49:
            numbers, mean = means.pop(0).split(", ")
            expected.append(f"Mean of episodes {numbers}, random actions included: return {mean}")
    assert capsys.readouterr().out.splitlines() == expected


def test_evaluation_has_a_line_after_that_of_its_episode(
    capsys: pytest.CaptureFixture[str],
) -> None:
    make_progress(kp.preset("reference")).on_episode(record(5, greedy_regret=1.2345))
    assert capsys.readouterr().out.splitlines() == [
        record(5).line(),
        "Greedy policy after episode 5: regret 1.23",
    ]


def figures(line: str) -> str:
    """Returns the text beside the bar."""
    return line.split(" ", 3)[3]


def test_bar_shows_speed_of_the_last_episodes(terminal: MakeTerminal) -> None:
    output = terminal()
    bar = make_progress(kp.preset("reference", episodes=100))
    for episode in range(13):
        bar.on_episode(record(episode))
    lines = output.lines()
    speed = f"{STEPS / 0.5:.0f} steps/s"
    assert lines[-1].startswith("training 13/100 ━━")
    assert figures(lines[-1]) == f"return -169 ε 0.50 loss 0.1 {speed} 0:44 left"
    assert figures(lines[0]) == "return -1 ε 0.50 loss 0.1"
    assert figures(lines[1]) == f"return -4 ε 0.50 loss 0.1 {speed} 0:49 left"


def test_time_left_is_shown_from_the_second_episode_with_updates(terminal: MakeTerminal) -> None:
    output = terminal()
    bar = make_progress(kp.preset("reference", episodes=100))
    bar.on_episode(record(0, loss=float("nan"), seconds=0.01))
    bar.on_phase("compiling")
    bar.on_episode(record(1, seconds=90.0))
    bar.on_episode(record(2, seconds=2.0))
    assert [re.findall(r"\d+:\d+ left", line) for line in output.lines()] == [
        *([], [], [], ["3:14 left"])
    ]


def test_time_left_is_never_0(terminal: MakeTerminal) -> None:
    output = terminal()
    bar = make_progress(kp.preset("reference", episodes=5))
    for episode in range(5):
        bar.on_episode(record(episode, seconds=1e-4))
    for phase in ("drawing", "evaluating", "finished"):
        bar.on_phase(phase)
    lines = output.lines()
    assert [re.findall(r"\d+:\d+ left", line) for line in lines] == [
        *([[]] + [["0:01 left"]] * 3),
        *([[]] * 4),
    ]
    assert [line.split()[0] for line in lines[4:]] == [
        *("training", "drawing", "evaluating", "finished")
    ]


def test_time_left_includes_the_remaining_evaluations(
    terminal: MakeTerminal, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = SimpleNamespace(now=100.0)
    clock.monotonic = lambda: clock.now
    monkeypatch.setattr("keras_pendulum.train.progress.time", clock)
    output = terminal()
    bar = make_progress(kp.preset("reference", episodes=50, evaluate_every=10))
    for episode in range(9):
        bar.on_episode(record(episode))
    bar.on_phase("evaluating")
    clock.now += 30.0
    bar.on_episode(record(9, greedy_regret=12.345))
    lines = output.lines()
    assert lines[-2].startswith("evaluating 9/50 ")
    assert lines[-1].startswith("training 10/50 ")
    assert "greedy 12.35 " in lines[-1]
    assert lines[-1].endswith("2:20 left")  # 40 episodes of 0.5 s and 4 evaluations of 30 s
    bar.on_episode(record(10))
    assert "greedy 12.35 " in output.lines()[-1]


def test_interrupted_run_has_no_time_left(terminal: MakeTerminal) -> None:
    output = terminal()
    bar = make_progress(kp.preset("reference", episodes=9))
    bar.on_episode(record(0))
    bar.on_episode(record(1))
    bar.on_phase("interrupted")
    *_, before, last = output.lines()
    assert before.endswith("left")
    assert last.startswith("interrupted 2/9 ")
    assert "left" not in last


def test_end_ends_the_line_once_also_before_the_first_episode(terminal: MakeTerminal) -> None:
    output = terminal(columns=60)
    bar = make_progress(kp.preset("reference", episodes=9))
    bar.on_phase("evaluating")
    bar.end()
    bar.on_phase("drawing")  # comes after the result was printed
    bar.end()
    assert output.lines() == ["evaluating"]
    assert output.text().endswith("\n")
    assert output.text().count("\n") == 1


def test_narrow_terminal_leaves_out_the_least_important_figures(terminal: MakeTerminal) -> None:
    shown = []
    for columns in (80, 70, 60, 50, 40):
        output = terminal(columns)
        bar = make_progress(kp.preset("reference", episodes=100))
        bar.on_episode(record(0))
        bar.on_episode(record(1, greedy_regret=9.0, episode_return=-1.0))
        _, line = output.lines()
        assert len(line) < columns
        assert "greedy 9 " in line
        shown.append([name for name in ("return", "ε", "loss", "steps/s", "left") if name in line])
    assert shown == [
        ["return", "ε", "loss", "steps/s", "left"],
        ["return", "ε", "loss", "left"],
        ["return", "ε", "left"],
        ["return", "left"],
        ["left"],
    ]


def drawn(output: Terminal) -> str:
    """Returns the output for 1 and 2 of 2 episodes, the first with the longer line."""
    bar = make_progress(kp.preset("reference", episodes=2))
    for episode in range(2):
        bar.on_episode(record(episode, seconds=3600.0 * (2 - episode)))
    return output.text()


def test_bar_needs_no_escape_codes(terminal: MakeTerminal) -> None:
    longer, shorter = drawn(terminal(columns=60)).split("\r")[1:]
    assert (longer + shorter).isprintable()
    assert len(longer) == len(shorter) == 59  # nothing of the longer line is left
    assert longer.startswith("training 1/2 ━━")


@pytest.mark.parametrize("encoding", ["cp1252", "cp437", "ascii"])
def test_bar_has_other_marks_where_the_code_page_lacks_them(
    encoding: str, terminal: MakeTerminal
) -> None:
    before, after = drawn(terminal(60, encoding)).split("\r")[1:]
    assert before.startswith("training 1/2 ##")
    assert re.fullmatch(r"#+-+", before.split()[2])
    assert re.fullmatch(r"#+", after.split()[2])


def test_dumb_terminal_gets_a_line_for_each_episode(terminal: MakeTerminal) -> None:
    assert drawn(terminal(term="dumb")) == "".join(
        f"{record(episode).line()}\n" for episode in range(2)
    )
