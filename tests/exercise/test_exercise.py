"""The exercises, their programs, hints and sets for a class, without training."""

from __future__ import annotations

import ast
import re
import runpy
from pathlib import Path
from typing import Any

import pytest
from conftest import ROOT, Command, Refusal

from keras_pendulum.diagnosis.faults import FAULTS
from keras_pendulum.errors import UserError
from keras_pendulum.exercise import __main__ as command
from keras_pendulum.exercise.check import answer, check
from keras_pendulum.exercise.class_sets import KEY, deal
from keras_pendulum.exercise.program import program, write_program
from keras_pendulum.exercise.table import CARTPOLE, EXERCISES, PENDULUM
from keras_pendulum.exercise.trial import run_trial

HEALTHY = (ROOT / "examples" / "my_dqn.py").read_text(encoding="utf-8")
# Programs that end at once, in place of a training.
START = 'ENVIRONMENT, ACTIONS, DISCOUNT, REWARD_SCALE = "Pendulum-v1", [-2, 2], 0.985, 1.0\n'
BROKEN = f"{START}def train():\n    raise ValueError('no such thing')\n"
ENDLESS = f"{START}def train():\n    print('begins', flush=True)\n    while True: pass\n"


def test_program_without_a_fault_is_the_example() -> None:
    assert program(0) == HEALTHY
    assert len(HEALTHY.splitlines()) <= 150


def test_example_imports_this_package_for_its_test_only() -> None:
    used = set(re.findall(r"\bkp\.(\w+)", HEALTHY)) - {"diagnose`"}
    assert used == {"Recorder", "evaluate_policy", "diagnose"}
    imported = {
        alias.name
        for node in ast.walk(ast.parse(HEALTHY))
        if isinstance(node, ast.Import)
        for alias in node.names
    }
    assert imported == {"time", "gymnasium", "keras", "numpy", "tensorflow", "keras_pendulum"}
    assert ".predict(" not in HEALTHY


def test_example_without_a_whole_episode_prints_the_mean_of_what_it_has(
    capsys: pytest.CaptureFixture[str],
) -> None:
    runpy.run_path(str(ROOT / "examples" / "my_dqn.py"))["train"](steps=20)
    means = re.findall(r"mean return (\S+),", capsys.readouterr().out)
    assert len(means) == 10
    assert all(float(mean) < 0 for mean in means)


def test_every_number_of_the_example_is_explained() -> None:
    numbers = re.findall(r"# (\[\d+\])", HEALTHY)
    page = (ROOT / "docs" / "exercises.md").read_text(encoding="utf-8")
    assert numbers == [f"[{n}]" for n in range(1, 21)]
    assert re.findall(r"^\| (\[\d+\]) \|", page, re.MULTILINE) == numbers


@pytest.mark.parametrize("number", EXERCISES)
def test_exercise_differs_in_one_to_three_lines_and_keeps_their_comments(number: int) -> None:
    each = EXERCISES[number]
    text = program(number)
    compile(text, "my_dqn.py", "exec")
    assert max(map(len, text.splitlines())) <= 100
    assert f'ENVIRONMENT = "{each.environment}"' in text
    old = [line for old, _ in each.changes for line in old.splitlines()]
    assert 1 <= len(old) <= 3
    assert sorted(re.findall(r"# \[\d+\].*", text)) == sorted(re.findall(r"# \[\d+\].*", HEALTHY))
    assert each.finding in FAULTS
    for place in re.findall(r"\[\d+\]", each.place):
        assert f"# {place}" in HEALTHY


def test_exercises_differ_and_cover_both_tasks() -> None:
    assert len(EXERCISES) == len({program(number) for number in EXERCISES}) == 20
    assert {each.environment for each in EXERCISES.values()} == {PENDULUM, CARTPOLE}
    assert len({each.finding for each in EXERCISES.values()}) >= 12


def test_symptom_does_not_name_the_finding() -> None:
    for each in EXERCISES.values():
        assert each.finding not in each.symptom
        assert "`" not in each.symptom


def test_unchanged_program_is_replaced_and_a_changed_one_is_not(tmp_path: Path) -> None:
    path = tmp_path / "my_dqn.py"
    write_program(3, path)
    write_program(7, path)
    assert path.read_text(encoding="utf-8") == program(7)
    path.write_text(program(7).replace("DISCOUNT = ", "DISCOUNT  = "), encoding="utf-8")
    with pytest.raises(UserError, match="holds changes of your own: name another file"):
        write_program(7, path)
    path.write_text("print(1)\n", encoding="utf-8")
    with pytest.raises(UserError, match="holds something else than a program of this command"):
        write_program(7, path)
    assert path.read_text(encoding="utf-8") == "print(1)\n"


def test_list_has_every_exercise_and_no_finding(in_process: Command) -> None:
    shown = in_process("exercise").stdout
    for number, each in EXERCISES.items():
        assert f"{number:2}  {each.environment}  {each.symptom}\n" in shown
        assert each.solution not in shown
    assert EXERCISES[7].symptom in in_process("exercise", 7).stdout


def test_hints_lead_to_the_solution(in_process: Command) -> None:
    each = EXERCISES[7]
    assert in_process("exercise", 7, "--hint").stdout == f"Hint 1 of 3. {each.question}\n"
    second = in_process("exercise", 7, "--hint", 2).stdout
    assert each.finding in second
    assert each.solution not in second
    assert each.solution in in_process("exercise", 7, "--hint", 3).stdout


def test_written_program_is_that_of_the_exercise(in_process: Command, tmp_path: Path) -> None:
    assert in_process("exercise", 7, "--out", "mine.py").stdout == "Wrote mine.py\n"
    assert (tmp_path / "mine.py").read_text(encoding="utf-8") == program(7)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["21"], "there is no exercise 21; expected a number from 1 to 20"),
        (["-1"], "there is no exercise -1; expected a number from 1 to 20"),
        (["--hint"], "--hint needs the number of an exercise, such as 7 --hint"),
        (["7", "--hint", "4"], "argument --hint: invalid choice: 4 (choose from 1, 2, 3)"),
        (["7", "--out", "no/my.py"], "cannot write no/my.py: there is no folder no"),
        (["7", "--check", "no.py"], "no.py: no such file; write it with `exercise 7 --out no.py`"),
        (
            ["7", "--check", "a", "--hint"],
            "--hint and --check do not go together: give one of them",
        ),
        (["--class", "3"], "--class needs --out FOLDER, and takes no number of an exercise"),
        (["--class", "0", "--out", "c"], "--class is 0; expected 1 to 200 with 3 for each student"),
        (["--class", "21", "--each", "1", "--out", "c"], "--class is 21; expected 1 to 20 with 1 "),
        (["--class", "2", "--each", "20", "--out", "c"], "--each is 20; expected 1 to 19"),
    ],
)
def test_mistake_is_one_line(
    words: list[str], message: str, refusal: Refusal, tmp_path: Path, monkeypatch: Any
) -> None:
    monkeypatch.chdir(tmp_path)
    assert message in refusal(command.main, words)


def test_students_of_a_class_have_different_sets_and_all_exercises_are_used() -> None:
    sets = deal(30, 3, seed=5)
    assert len(set(sets)) == 30
    assert sets == deal(30, 3, seed=5) != deal(30, 3, seed=6)
    used = [sum(number in own for own in sets) for number in EXERCISES]
    assert max(used) - min(used) <= 1
    assert all(len(set(own)) == 3 for own in sets)
    assert len(set(deal(20, 1, seed=0))) == 20


def test_folder_of_a_class_has_programs_for_students_and_a_key_for_the_teacher(
    in_process: Command, tmp_path: Path
) -> None:
    in_process("exercise", "--class", 4, "--seed", 5, "--out", "c")
    assert sorted(path.name for path in (tmp_path / "c").iterdir()) == [
        *("student_01", "student_02", "student_03", "student_04"),
        KEY,
    ]
    key = (tmp_path / "c" / KEY).read_text(encoding="utf-8")
    for student, exercises in enumerate(deal(4, 3, seed=5), 1):
        own = tmp_path / "c" / f"student_{student:02}"
        assert f"| {student:02} | {', '.join(map(str, exercises))} |" in key
        tasks = (own / "tasks.txt").read_text(encoding="utf-8")
        for number in exercises:
            text = (own / f"exercise_{number:02}.py").read_text(encoding="utf-8")
            assert text == program(number)
            assert EXERCISES[number].symptom in tasks
            assert EXERCISES[number].solution in key
            assert EXERCISES[number].solution not in tasks
    again = in_process("exercise", "--class", 4, "--out", "c")
    assert again.returncode == 2
    assert "c exists and is not an empty folder: name another one" in again.stderr


RESULT: dict[str, Any] = {
    "regret": 9.0,
    "random_return": -1200.0,
    "optimum": -130.0,
    "findings": [],
    "notes": [],
}
FINDING = {
    "name": "exploration",
    "variant": "",
    "evidence": "about 91% of the actions are random",
    "healthy": "below 10 %",
    "explanation": "The share does not fall.",
    "page": "docs/page.md",
}


def test_good_agent_without_a_finding_is_healthy() -> None:
    healthy, text = answer(7, RESULT)
    assert healthy
    assert text == (
        "Healthy: regret 9.0 (up to 43 is healthy), and diagnose finds nothing. "
        "Exercise 7 is solved."
    )


@pytest.mark.parametrize(
    ("change", "shown"),
    [
        (
            {"findings": [FINDING]},
            "1. exploration: about 91% of the actions are random (healthy: b",
        ),
        ({"notes": [FINDING]}, "1. exploration: about 91% of the actions are random (healthy: b"),
        ({"regret": 44.0}, "diagnose finds nothing. Try another seed"),
        ({"regret": None, "findings": [FINDING]}, "Not healthy yet: regret inf"),
    ],
)
def test_finding_or_regret_is_not_healthy(change: dict[str, Any], shown: str) -> None:
    healthy, text = answer(7, RESULT | change)
    assert not healthy
    assert shown in text
    assert text.endswith("A hint: exercise 7 --hint")


def test_note_of_another_fault_is_healthy() -> None:
    assert answer(1, RESULT | {"notes": [FINDING]})[0]


def test_program_with_an_error_is_not_judged(tmp_path: Path, capfd: Any) -> None:
    path = tmp_path / "mine.py"
    path.write_text(BROKEN, encoding="utf-8")
    with pytest.raises(UserError, match=r"mine.py ended with an error, so it was not judged"):
        check(7, path, seconds=100)
    assert "ValueError: no such thing" in capfd.readouterr().err


def test_program_that_does_not_end_is_stopped(tmp_path: Path, capfd: Any) -> None:
    path = tmp_path / "mine.py"
    path.write_text(ENDLESS, encoding="utf-8")
    with pytest.raises(UserError, match=r"mine.py was stopped after 4 s; does a loop not end"):
        check(7, path, seconds=4)


@pytest.mark.parametrize(
    ("text", "environment", "message"),
    [
        (START, PENDULUM, "has no train; the check needs ENVIRONMENT, ACTIONS"),
        (BROKEN, CARTPOLE, "ENVIRONMENT is 'Pendulum-v1'; expected CartPole-v1"),
        (f"{START}def train():\n    return 1\n", PENDULUM, "does not return network, buffer, env"),
    ],
)
def test_program_without_what_the_check_needs_is_refused(
    text: str, environment: str, message: str, tmp_path: Path
) -> None:
    path = tmp_path / "mine.py"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(UserError, match=message):
        run_trial(path, environment)
