import json
import re
from pathlib import Path

import numpy as np
import pytest
from conftest import Refusal
from exact_agent import coarse_value, exact_values, subject

import keras_pendulum as kp
from keras_pendulum.diagnose import __main__ as command
from keras_pendulum.diagnose import comparisons, measurement
from keras_pendulum.diagnose.diagnosis import diagnose, diagnose_subject
from keras_pendulum.diagnose.report import as_html


@pytest.fixture(autouse=True)
def _coarse_tables(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(measurement, "discounted_value", coarse_value)
    monkeypatch.setattr(comparisons, "other_value", coarse_value)


@pytest.fixture
def weights(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("weights") / "untrained.h5"
    kp.save_weights(kp.DQN((8, 8)), path)
    return path


def test_function_is_not_hidden_by_the_room_of_its_name() -> None:
    assert kp.diagnose is diagnose
    assert kp.diagnose is diagnose  # the first use has imported the room
    assert command.main.__module__ == "keras_pendulum.diagnose.__main__"


def test_first_line_is_the_answer(weights: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert command.main([str(weights)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("too-few-updates: slope of learned on exact values ")
    assert "g = 1, γ = 0.9, 60 starts" in lines[1]
    assert "   Read: docs/diagnose.md#too-few-updates" in lines


def test_json_has_findings_and_signals(weights: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert command.main([str(weights), "--json", "--gravity", "10", "--discount", "0.98"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["gravity"], found["discount"]) == (10, 0.98)
    assert found["findings"][0]["page"].startswith("docs/diagnose.md#")
    assert found["signals"]["value_slope"] < 0.3


def test_report_is_one_escaped_file(weights: Path, tmp_path: Path) -> None:
    report = tmp_path / "report.html"
    assert command.main([str(weights), "--report", str(report)]) == 0
    text = report.read_text(encoding="utf-8")
    assert text.startswith("<!DOCTYPE html>") and "width=device-width" in text
    assert not re.findall(r'(?:src|href)="(?!data:)', text)

    agent = subject(lambda o: exact_values(o)[:, ::-1])
    named = type(agent)(**{**vars(agent), "name": '<script>alert("x")</script>$\n'})
    page = as_html(diagnose_subject(named))
    assert "<script" not in page and "&lt;script&gt;" in page


def test_figure_is_drawn_without_q_values_too() -> None:
    def push(observation: object) -> float:
        return 2.0

    figure = diagnose(push, gravity=1.0, discount=0.9).figure()
    assert len(figure.axes) == 1
    assert len(diagnose_subject(subject(exact_values)).figure().axes) == 4


def test_values_that_are_not_finite_are_a_finding() -> None:
    agent = kp.q_function(lambda o: np.zeros((len(o), 41)))
    found = diagnose(agent)
    assert found.findings[0].name == "broken-network"
    json.dumps(found.as_json(), allow_nan=False)


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["nothing.h5"], "error: nothing.h5: no such file"),
        (["{weights}", "--gravity", "-1"], "error: gravity is -1"),
        (["{weights}", "--discount", "2"], "error: discount is 2"),
        (["{weights}", "--torques=a"], "error: argument --torques: 'a' is no list of numbers"),
        (["{weights}", "--torques=-1,1"], "error: torques has 2 numbers"),
        (["{folder}"], "error: {folder}: holds no run of Pendulum-v1"),
        (["cartpole"], "error: the agent belongs to CartPole-v1"),
        (["{weights}", "--report", "{weights}"], "error: {weights} holds something else than"),
    ],
)
def test_mistake_is_one_line(words: list[str], line: str, weights: Path, refusal: Refusal) -> None:
    names = {"weights": weights.as_posix(), "folder": weights.parent.as_posix()}
    found = refusal(command.main, [word.format(**names) for word in words])
    assert found.startswith(line.format(**names))
