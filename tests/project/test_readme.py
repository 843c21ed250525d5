"""README.md: its tables, figures, commands and links are those of the repository."""

from __future__ import annotations

import json
import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import h5py
import pytest
from conftest import ROOT
from test_dependencies import PYTHONS, WITHOUT_WHEELS
from test_floor_plan import imported_modules

import keras_pendulum as kp
from benchmarks.choosing import ARMS
from benchmarks.departures import BEFORE, departures, interval, measured
from benchmarks.report import RESULTS, markdown

PACKAGE = Path(kp.__file__).parent

README = (ROOT / "README.md").read_text(encoding="utf-8")
DOCUMENTS = sorted(ROOT.glob("*.md")) + sorted(ROOT.glob("docs/*.md"))
ROWS = [(preset, name) for preset in BEFORE for name in departures(preset)]
COMMANDS = sorted(
    {match.strip() for match in re.findall(r"python -m keras_pendulum\.[^\n`#&]+", README)}
)


def table_of_departures(preset: str) -> dict[str, list[str]]:
    """Returns the other cells of each row by the setting in the first cell."""
    table = README.split(f"departures_{preset}.json -->")[1].split("\n\n")[0].strip().splitlines()
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in table[2:]]
    return {row[0].strip("`"): row[1:] for row in rows}


def summary(regrets: list[float]) -> str:
    """Returns mean and worst regret, from 10 runs on with the interval of the mean."""
    uncertainty = f" ({interval(regrets)})" if len(regrets) >= 10 else ""
    return f"mean {sum(regrets) / len(regrets):.1f}{uncertainty}, worst {max(regrets):.1f}"


def fenced(language: str, document: Path = ROOT / "README.md") -> list[str]:
    """Returns the blocks of a language in a document, each without the newline at its end."""
    text = document.read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)\n```$", text, re.MULTILINE | re.DOTALL)


def test_lines_for_windows_are_the_two_lines() -> None:
    for line, block in zip(fenced("sh")[:2], fenced("bat"), strict=True):
        # `.ci/run` finds the line of the tests by its `-m pytest`.
        for ours, theirs in (
            ("python3 ", "py -3.13 "),
            ("/bin/", "\\Scripts\\"),
            ("python -m pytest", "pytest"),
        ):
            line = line.replace(ours, theirs)
        assert block.splitlines() == line.split(" && ")


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_shell_lines_have_double_quotes_only(document: Path) -> None:
    # The command prompt of Windows passes single quotes on.
    for block in fenced("(?:sh|bat)", document):
        assert "'" not in re.sub(r" #.*", "", block)


def test_pythons_and_systems_are_those_of_the_dependencies() -> None:
    start = " ".join(README.split("## Two lines")[1].split("Training ends")[0].split())
    *others, last = PYTHONS
    assert f"Python {', '.join(others)} or {last} on Linux" in start
    for system in ("Python 3.14", *WITHOUT_WHEELS):
        assert f"**{system}" in start


@pytest.mark.parametrize("preset", BEFORE)
def test_departures_table_lists_the_departures_of_the_preset(preset: str) -> None:
    assert list(table_of_departures(preset)) == departures(preset)


def test_figures_of_the_default_run_are_those_of_the_shipped_policy() -> None:
    score = kp.evaluate_policy(kp.load_weights(kp.find_weights("reference")))
    for words, figure in {
        "mean return": score.mean_return,
        "Best possible on the same starts:": score.optimal_mean_return,
        "Regret:": score.regret,
    }.items():
        found = re.search(rf"{words} (-?[\d.]+)", README)
        assert found is not None
        # Floating-point rounding of another processor may change an action.
        assert float(found.group(1)) == pytest.approx(figure, abs=0.015)


@pytest.mark.parametrize(("preset", "name"), ROWS)
def test_departures_row_has_the_values_and_the_measured_regret(preset: str, name: str) -> None:
    before, after, why, regret = table_of_departures(preset)[name]
    assert before.replace(" ", "") == str(getattr(kp.preset(BEFORE[preset]), name))
    assert after.replace(" ", "") == str(getattr(kp.preset(preset), name))
    assert len(why) > 20
    assert regret == summary(measured(preset)[name])


@pytest.mark.parametrize("preset", BEFORE)
def test_departures_text_has_the_measured_regrets(preset: str) -> None:
    flowing = " ".join(README.split())
    regrets = measured(preset)
    assert f"with all of them it is {summary(regrets[preset])};" in flowing
    assert f"of `{BEFORE[preset]}` {summary(regrets[BEFORE[preset]])}." in flowing


def rows_of(name: str) -> list[dict[str, Any]]:
    """Returns the rows of a benchmark's table."""
    rows: list[dict[str, Any]] = json.loads((RESULTS / f"{name}.json").read_text("utf-8"))["rows"]
    return rows


def test_speeds_in_the_text_are_those_of_the_tables() -> None:
    first, ours = rows_of("original_run")
    here, peer, other = rows_of("learning")
    whole, kept = "seconds of the whole process", "seconds until its weights are saved"
    small, large, step = rows_of("inner_loops")
    cartpole, torch = rows_of("cartpole_speed")
    steps = "environment steps per second"
    for words in (
        f"takes {ours['seconds']} s instead of {first['seconds']:.0f} s, "
        f"{ours['times as fast']:.0f} times as fast.",
        f"command takes {here[whole]:.0f} s, with its policy saved after {here[kept]:.0f}, where "
        f"Stable-Baselines3 takes {peer[whole]:.0f} s and sbx {other[whole]:.0f} s",
        f"(their mean regret {peer['mean regret']} and {other['mean regret']}, "
        f"here {here['mean regret']}).",
        f"takes {small['ratio']} times what its matrix products",
        f"at batch 128 {large['ratio']} times;",
        f"included, {float(step['here'].split()[0]):.0f} µs, {step['bare'].split()[0]} of them",
        f"makes {cartpole[steps]} environment steps per second, {cartpole['times as fast']} times "
        f"as many as the PyTorch program ({torch[steps]})",
    ):
        assert words in " ".join(README.split())


def test_choosing_table_has_the_measured_regrets() -> None:
    rows = rows_of("choosing")
    assert [row["training"] for row in rows] == [arm.partition(":")[0] for arm in ARMS]
    shown = README.split("choosing.json -->")[1].split("\n\n")[0].strip().splitlines()[2:]
    assert shown == [f"| {row['training']} | {summary(row['regrets'])} |" for row in rows]


def test_last_regret_page_has_the_measured_table() -> None:
    page = (ROOT / "docs" / "last_regret.md").read_text(encoding="utf-8")
    shown = page.split("benchmarks.last_regret reference -->\n")[1].split("<!--")[0]
    assert shown == markdown(rows_of("last_regret_reference"))


def test_study_table_is_the_measured_one() -> None:
    def rows(text: str) -> list[list[str]]:
        lines = [line for line in text.splitlines() if line.startswith("|")][2:]
        return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]

    shown = README.split("## What each change is worth")[1].split("\n## ")[0]
    measured = rows((ROOT / "docs" / "study" / "table.md").read_text(encoding="utf-8"))
    assert rows(shown) == [[row[0], row[3], row[4], row[6]] for row in measured]
    assert all(row[2] == "10" for row in measured)


def test_regrets_of_the_first_seeds_are_the_measured_ones() -> None:
    found = re.search(
        r"Regret: ([\d.]+)\n.*With `--seed 1` it is ([\d.]+) and\nwith `--seed 2` ([\d.]+)\.",
        README,
        re.DOTALL,
    )
    assert found is not None
    regrets = measured("reference")["reference"]
    assert [float(figure) for figure in found.groups()] == regrets[:3]


@pytest.mark.parametrize("line", COMMANDS)
def test_command_has_the_flags_that_the_readme_uses(line: str) -> None:
    _, _, module, *words = shlex.split(line)
    shown = subprocess.run(
        [sys.executable, "-m", module, "--help"], capture_output=True, text=True, check=True
    ).stdout
    for word in words:
        if word.startswith("--"):
            assert re.search(rf"{word}\b", shown), word


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_links_lead_to_files(document: Path) -> None:
    for link in re.findall(
        r"\]\((?!https:)([^)#]+)(?:#[^)]*)?\)", document.read_text(encoding="utf-8")
    ):
        assert (document.parent / link).exists(), link


def test_map_of_rooms_is_complete_and_its_files_exist() -> None:
    section = README.split("## Reading the code")[1]
    rooms = re.findall(r"^\| `(\w+)/` \|", section, re.MULTILINE)
    assert set(rooms) == {path.parent.name for path in PACKAGE.glob("*/__init__.py")}
    for name in re.findall(r"`([a-z_]+/\w+\.(?:py|h5))`", README):
        assert (PACKAGE / name).exists() or (ROOT / name).exists() or "runs" in name, name


def test_only_the_dqn_has_at_most_800_lines() -> None:
    section = README.split("**Only the DQN** is ")[1]
    files = re.findall(r"`((?:dqn|train)/\w+\.py)`", section)
    lines = sum(len((PACKAGE / name).read_text(encoding="utf-8").splitlines()) for name in files)
    assert len(files) == 9
    assert lines == int(section.split(" ")[0]) <= 800
    rooms = {"dqn", "train", "config", "environments", "errors", "history"}
    for name in files:
        imported = imported_modules(PACKAGE / name)
        assert {module.split(".")[0] for module in imported} <= rooms, name


@pytest.mark.parametrize("name", sorted(path.stem for path in (ROOT / "weights").glob("*.h5")))
def test_shipped_policy_has_the_return_that_its_file_records(name: str) -> None:
    path = kp.find_weights(name)
    with h5py.File(path) as file:
        attributes = file["keras_pendulum"].attrs.items()
        recorded = {
            key: value.decode() if isinstance(value, bytes) else value for key, value in attributes
        }
    network = kp.load_weights(path)
    assert recorded["preset"] == json.loads(recorded["config"])["preset"] == name
    assert recorded["seed"] == json.loads(recorded["config"])["seed"]
    assert json.loads(recorded["versions"]).keys() >= {"tensorflow", "keras", "gymnasium", "numpy"}
    score = kp.evaluate_policy(network)
    assert score.mean_return == pytest.approx(recorded["evaluated_return"], abs=0.01)
