"""Agents in the user's own code, on the command line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from conftest import Command

import keras_pendulum as kp
from keras_pendulum.evaluate.named_policy import names_code

CODE = """
import keras
import keras_pendulum as kp
from beside import GAIN

def push(observation):
    return float(max(-2, min(2, -GAIN * observation[1] - observation[2])))

values = kp.q_function(lambda x: x @ [[0, 0, 0], [-1, 0, 1], [-1, 0, 1]])
network = kp.DQN((8,), 3, seed=1)
name = "swingup"
number = 3

def broken(observation):
    return observation.torque
"""


@pytest.fixture
def code(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.path", ["", *__import__("sys").path])
    (tmp_path / "beside.py").write_text("GAIN = 9.0", encoding="utf-8")
    path = tmp_path / "my agent.py"
    path.write_text(CODE, encoding="utf-8")
    (tmp_path / "agents27.py").write_text(CODE, encoding="utf-8")
    return path


def test_function_in_a_file_or_module_is_evaluated(in_process: Command, code: Path) -> None:
    printed = []
    for word in ("my agent.py:push", f"{code}:push", "agents27:push"):
        done = in_process("evaluate", word, "--episodes", "2", "--json")
        assert done.returncode == 0, done.stderr
        printed.append(json.loads(done.stdout))
        assert printed[-1].pop("weights") == word
    assert printed[0] == printed[1] == printed[2]
    assert -60 < printed[0]["mean_return"] < -1
    assert printed[0]["discount_regret"] is None


def test_other_objects_in_a_file_are_evaluated(in_process: Command, code: Path) -> None:
    words = ["--episodes", "1", "--discount", "0.9"]
    done = in_process("evaluate", "my agent.py:values", *words)
    assert "Exact policy for the discount 0.9" in done.stdout, done.stderr
    done = in_process("evaluate", "my agent.py:network", "--torques=-1,0,1", *words)
    assert done.returncode == 0, done.stderr
    done = in_process("evaluate", "my agent.py:name", "--episodes", "1")
    assert "g = 10" in done.stdout, done.stderr


WRONG = [
    (["my agent.py:pusch"], "my agent.py: has no pusch; did you mean push?"),
    (["my agent.py"], "my agent.py: names a file, but no agent in it; expected my agent.py:NAME"),
    (["mine.py:Agent()"], "write `agent = Agent()` in mine.py, and give mine.py:agent"),
    (["mine.py:trainer.agent"], "write `agent = trainer.agent` in mine.py, and give mine.py:agent"),
    (["missing.py:push"], "missing.py: no such file; expected FILE.py:NAME"),
    (["missing27.agents:push"], "missing27.agents: no such module; expected PACKAGE.MODULE:NAME"),
    (["my agent.py:number"], "my agent.py:number: agent is 3; expected a DQN"),
    (["my agent.py:broken"], "episode 0, step 0: the agent raised AttributeError"),
    (["bad.py:push"], "bad.py: raised ZeroDivisionError: division by zero (bad.py, line 2)"),
    (["syntax.py:push"], "syntax.py: raised SyntaxError"),
    (["my agent.py:push", "--torques=1,2"], "a number of the type float64; expected an integer"),
    (["my agent.py:push", "--torques=1,x"], "'1,x' is not a list of numbers such as -2,0,2"),
    (["my agent.py:push", "--activation", "relu"], "--activation belongs to a weights file"),
    (["reference", "--discount", "2"], "discount is 2.0; expected a number from 0 to 1"),
]


@pytest.mark.parametrize(("words", "problem"), WRONG, ids=lambda value: str(value)[:50])
def test_wrong_agent_is_one_line(
    words: list[str], problem: str, code: Path, in_process: Command
) -> None:
    Path("bad.py").write_text("x = 1\n1 / 0\n", encoding="utf-8")
    Path("syntax.py").write_text("def (", encoding="utf-8")
    done = in_process("evaluate", *words)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("error: ")
    assert problem in done.stderr
    assert done.stderr.count("\n") == 1


def test_form_of_code() -> None:
    forms = {
        "a.py:b": True,
        "C:\\folder\\a.py:b": True,
        "package.module:name": True,
        "reference": False,
        "run/weights.h5": False,
        "C:\\folder\\weights.h5": False,
        "a.py": True,
        "a.py:2": True,
        "a b:c": False,
    }
    assert {word: names_code(word) for word in forms} == forms


def test_file_whose_name_looks_like_code_is_a_file(code: Path) -> None:
    Path("a:b").touch()
    assert not names_code("a:b")


def test_python_function_runs_no_code_of_a_name(code: Path) -> None:
    with pytest.raises(kp.WeightsError, match="no such file"):
        kp.evaluate_policy("my agent.py:push")
