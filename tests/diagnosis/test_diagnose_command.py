import json
import re
from pathlib import Path
from urllib.request import url2pathname

import pytest
from conftest import Refusal
from exact_agent import coarse_value, diagnose_values, exact_values

import keras_pendulum as kp
from keras_pendulum.diagnosis import __main__ as command
from keras_pendulum.diagnosis.report import as_html
from keras_pendulum.optimum import pendulum


@pytest.fixture(autouse=True)
def _coarse_tables(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pendulum, "discounted_value", coarse_value)


@pytest.fixture
def weights(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("weights") / "untrained.h5"
    kp.save_weights(kp.DQN((8, 8)), path)
    return path


def test_first_line_is_the_answer(capsys: pytest.CaptureFixture[str]) -> None:
    assert command.main(["original"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("too-few-updates: slope of learned on exact values ")
    assumed = "g = 1, γ = 0.9, 41 torques from -2 to 2 N·m, rewards times 1, 60 starts; "
    assert lines[1].startswith(f"Agent original, {assumed}")
    assert "   Read: docs/my_dqn_does_not_learn.md#too-few-updates" in lines


def test_agent_has_the_name_that_was_typed(
    weights: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(weights.parent)
    Path("code.py").write_text("def hold(observation):\n    return 2.0\n", encoding="utf-8")
    for word in (weights.name, "code.py:hold"):
        assert command.main([word, "--gravity", "1"]) == 0
        assert f"\nAgent {word}, g = 1, " in capsys.readouterr().out


def test_json_has_findings_and_signals(weights: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert command.main([str(weights), "--json", "--gravity", "10", "--discount", "0.98"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["gravity"], found["discount"]) == (10, 0.98)
    assert found["findings"][0]["page"].startswith("docs/my_dqn_does_not_learn.md#")
    assert found["signals"]["value_slope"] < 0.3


def test_report_is_one_escaped_file(weights: Path, tmp_path: Path) -> None:
    report = tmp_path / "report.html"
    assert command.main([str(weights), "--report", str(report)]) == 0
    text = report.read_text(encoding="utf-8")
    assert text.startswith("<!DOCTYPE html>") and "width=device-width" in text
    assert not re.findall(r'(?:src|href)="(?!data:|file:)', text)
    linked = re.findall(r'href="([^"]+)"', text)
    assert linked and all(
        Path(url2pathname(link.removeprefix("file://").partition("#")[0])).is_file()
        for link in linked
    )

    diagnosis = diagnose_values(lambda o: exact_values(o)[:, ::-1])
    diagnosis.measurement.policy.name = '<script>alert("x")</script>$\n'
    page = as_html(diagnosis)
    assert "<script" not in page and "&lt;script&gt;" in page


def test_figure_is_drawn_without_q_values_too() -> None:
    assert len(diagnose_values(exact_values, bare=True).figure().axes) == 1
    assert len(diagnose_values(exact_values).figure().axes) == 4


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["nothing.h5"], "error: nothing.h5: no such file"),
        (["{weights}", "--gravity", "-1"], "error: gravity is -1"),
        (["{weights}", "--discount", "2"], "error: discount is 2"),
        (["{weights}", "--torques=a"], "error: argument --torques: 'a' is not a list of numbers"),
        (["{weights}", "--torques=-1,1"], "error: torques has 2 numbers"),
        (["{folder}"], "error: {folder}: holds no run (no pendulum_weight.h5"),
        (["{folder}/agents.py:Trainer"], "error: {folder}/agents.py:Trainer: agent is the class "),
        (["cartpole", "--gravity", "1"], "error: gravity belongs to Pendulum-v1"),
        (
            ["{weights}", "--report", "{weights}"],
            "error: --report is {weights}: expected a",
        ),
    ],
)
def test_mistake_is_one_line(words: list[str], line: str, weights: Path, refusal: Refusal) -> None:
    (weights.parent / "agents.py").write_text("class Trainer: pass", encoding="utf-8")
    names = {"weights": weights.as_posix(), "folder": weights.parent.as_posix()}
    found = refusal(command.main, [word.format(**names) for word in words])
    assert found.startswith(line.format(**names))
