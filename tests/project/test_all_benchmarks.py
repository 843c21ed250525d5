"""benchmarks.all: it runs the commands in their order, and continues after a stop."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from benchmarks import all as all_benchmarks
from benchmarks.all import main, missing_packages
from benchmarks.commands import COMMANDS, FOLDER, PYTHON, Command
from benchmarks.learning.study import publish
from benchmarks.resumable import measure_each

NAMES = [command.name for command in COMMANDS]


class Runs:
    """Notes the commands that are run, and answers with an exit status."""

    def __init__(self, failing: str = "", killed_at: str = "") -> None:
        self.names: list[str] = []
        self.lines: list[list[str]] = []
        self._failing, self._killed_at = failing, killed_at

    def __call__(self, line: Sequence[str]) -> int:
        module = line[2].removeprefix("benchmarks.")
        if module == self._killed_at:
            raise KeyboardInterrupt
        self.names.append(module)
        self.lines.append([*line])
        return int(module == self._failing)


@pytest.fixture(autouse=True)
def all_packages(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(all_benchmarks, "missing_packages", lambda packages, python: [])


def modules(commands: Sequence[Command]) -> list[str]:
    return [command.module for command in commands]


def test_all_runs_every_command_in_order_and_says_what_is_left(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    runs = Runs()
    assert main([], work=tmp_path, run=runs) == 0
    assert runs.names == modules(COMMANDS)
    # The optima decide every regret, and the shipped networks what the pages print.
    assert runs.names[:2] == ["learning.shipped_optima", "learning.preset_results"]
    assert runs.names[-1] == "tables"
    first = capsys.readouterr().out.splitlines()[0]
    hours = sum(command.minutes for command in COMMANDS) / 60
    assert first.startswith(f"[1 of {len(COMMANDS)}] python -m benchmarks.learning.shipped_optima")
    assert first.endswith(f"{hours:.1f} hours left")


def test_stopped_command_is_repeated_and_finished_ones_are_not(tmp_path: Path) -> None:
    before, after, again = Runs(killed_at="learning.finer_torques"), Runs(), Runs()
    with pytest.raises(KeyboardInterrupt):
        main([], work=tmp_path, run=before)
    assert main([], work=tmp_path, run=after) == 0
    assert after.names[0] == "learning.finer_torques"
    assert before.names + after.names == modules(COMMANDS)
    assert main([], work=tmp_path, run=again) == 0
    assert again.names == []


def test_failed_command_is_named_and_repeated(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first, second = Runs(failing="files.hostile_files"), Runs()
    assert main([], work=tmp_path, run=first) == 1
    assert first.names == modules(COMMANDS)
    assert "failed: python -m benchmarks.files.hostile_files." in capsys.readouterr().err
    assert main([], work=tmp_path, run=second) == 0
    assert second.names == ["files.hostile_files"]


def test_nothing_follows_a_failed_command_that_others_need(tmp_path: Path) -> None:
    runs = Runs(failing="learning.preset_results")
    assert main([], work=tmp_path, run=runs) == 1
    assert runs.names[-1] == "learning.preset_results"


def test_command_without_its_packages_is_left_out_with_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(
        all_benchmarks,
        "missing_packages",
        lambda packages, python: [name for name in packages if name == "stable_baselines3"],
    )
    runs = Runs()
    assert main([], work=tmp_path, run=runs) == 0
    left_out = [each for each in COMMANDS if "stable_baselines3" in each.packages]
    assert runs.names == modules([each for each in COMMANDS if each not in left_out])
    lines = [line for line in capsys.readouterr().out.splitlines() if line.startswith("left out")]
    assert lines == [
        f"left out: {each.line}: not installed: stable_baselines3 (extra `{each.extra}`)"
        for each in left_out
    ]
    assert {each.extra for each in left_out} == {"bench", "peers"}


def test_missing_packages_are_found() -> None:
    assert missing_packages(["json", "no_such_package"], sys.executable) == ["no_such_package"]


def test_only_runs_named_commands_even_if_they_have_finished(tmp_path: Path) -> None:
    for _ in range(2):
        runs = Runs()
        names = ["tables", "learning.departures cartpole"]
        assert main(["--only", *names], work=tmp_path, run=runs) == 0
        assert runs.names == ["learning.departures", "tables"]
        assert runs.lines[0][3:] == [str(tmp_path / "learning"), "cartpole"]


def test_unknown_name_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SystemExit, match=r"--only quality: not one of .*tables"):
        main(["--only", "quality"], work=tmp_path, run=Runs())


def test_list_prints_the_commands_and_runs_none(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    runs = Runs()
    main(["--only", "tables"], work=tmp_path, run=Runs())
    capsys.readouterr()
    assert main(["--list"], work=tmp_path, run=runs) == 0
    lines = [line.split(" | ") for line in capsys.readouterr().out.splitlines()[2:-2]]
    assert [line[0].removeprefix("| ") for line in lines] == NAMES
    assert {line[0] for line in lines if line[-1].startswith("yes")} == {"| tables"}
    assert runs.names == []


def test_another_machine_does_not_continue(tmp_path: Path) -> None:
    main(["--only", "tables"], work=tmp_path, run=Runs())
    file = tmp_path / "finished.json"
    content: dict[str, Any] = json.loads(file.read_text("utf-8"))
    file.write_text(json.dumps(content | {"machine": "64 cores"}), "utf-8")
    with pytest.raises(SystemExit, match="begun on 64 cores"):
        main([], work=tmp_path, run=Runs())


def test_commands_get_the_folder_and_the_python_that_they_name(tmp_path: Path) -> None:
    runs = Runs()
    main(["--python", "other-python"], work=tmp_path, run=runs)
    for command, line in zip(COMMANDS, runs.lines, strict=True):
        room = str(tmp_path / command.module.split(".")[0])
        assert line[3:] == [
            {FOLDER: room, PYTHON: "other-python"}.get(each, each) for each in command.arguments
        ]


def test_published_study_names_its_machine(tmp_path: Path) -> None:
    study, docs = tmp_path / "study", tmp_path / "docs"
    for folder in (study, docs):
        folder.mkdir()
    for name in ("table.md", "table.csv", "figure.png"):
        (study / name).write_bytes(name.encode())
    rows = [{"arm": "original", "regrets": [1.0]}]
    (study / "table.json").write_text(json.dumps({"versions": {}, "rows": rows}), "utf-8")
    publish(study, docs)
    table = json.loads((docs / "table.json").read_text("utf-8"))
    assert table["rows"] == rows
    assert " cores of " in table["machine"]
    assert (docs / "figure.png").read_bytes() == b"figure.png"


def test_finished_results_are_used_again(tmp_path: Path) -> None:
    measured = []

    def measure(number: int) -> dict[str, Any]:
        measured.append(number)
        if number == 3:
            raise KeyboardInterrupt
        return {"square": number**2}

    items = [(str(number), partial(measure, number)) for number in (1, 2, 3)]
    for _ in range(2):
        with pytest.raises(KeyboardInterrupt):
            measure_each(items, str(tmp_path / "new"), "squares")
    assert measured == [1, 2, 3, 3]
    results = measure_each(items[:2], str(tmp_path / "new"), "squares")
    assert results == [{"square": 1}, {"square": 4}]
