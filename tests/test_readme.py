"""README says what is so: its table, its figures, its commands and its links."""

from __future__ import annotations

import json
import re
import shlex
import subprocess
import sys
from pathlib import Path

import h5py
import pytest

import keras_pendulum as kp
from benchmarks.departures import departures

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
DEPARTURES: dict[str, list[float]] = json.loads(
    (ROOT / "benchmarks" / "departures.json").read_text()
)
COMMANDS = sorted(
    {match.strip() for match in re.findall(r"python -m keras_pendulum\.[^\n`#&]+", README)}
)


def table_of_departures() -> dict[str, list[str]]:
    """Setting -> the other cells of its row."""
    table = README.split("departures.json -->")[1].split("\n\n")[0].strip().splitlines()
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in table[2:]]
    return {row[0].strip("`"): row[1:] for row in rows}


def summary(regrets: list[float]) -> str:
    return f"mean {sum(regrets) / len(regrets):.1f}, worst {max(regrets):.1f}"


def test_the_table_names_every_departure_and_no_other() -> None:
    assert list(table_of_departures()) == departures()


def test_the_learning_that_was_measured_is_as_good_as_promised() -> None:
    assert max(DEPARTURES["reference"][:3]) <= 8


def test_the_shipped_policy_is_as_good_as_the_figures_say() -> None:
    score = kp.evaluate_policy(kp.load_weights(kp.find_weights("reference")))
    for words, figure in {
        "mean return": score.mean_return,
        "Best possible on the same starts:": score.optimal_mean_return,
        "Regret:": score.regret,
    }.items():
        found = re.search(rf"{words} (-?[\d.]+)", README)
        assert found is not None
        # On another processor a last digit may turn one action.
        assert float(found.group(1)) == pytest.approx(figure, abs=0.015)


@pytest.mark.parametrize("name", table_of_departures())
def test_a_row_has_the_presets_values_and_the_measured_regret(name: str) -> None:
    original, reference, why, measured = table_of_departures()[name]
    assert original.replace(" ", "") == str(getattr(kp.preset("original"), name))
    assert reference.replace(" ", "") == str(getattr(kp.preset("reference"), name))
    assert len(why) > 20
    assert measured == summary(DEPARTURES[name])


def test_the_text_beside_the_table_has_the_measured_regrets_too() -> None:
    flowing = " ".join(README.split())
    assert f"With all of them it is {summary(DEPARTURES['reference'])};" in flowing
    assert f"the original's is {summary(DEPARTURES['original'])}." in flowing


def test_the_regrets_of_the_first_seeds_are_the_measured_ones() -> None:
    found = re.search(
        r"Regret: ([\d.]+)\n.*With `--seed 1` it is ([\d.]+) and\nwith `--seed 2` ([\d.]+)\.",
        README,
        re.DOTALL,
    )
    assert found is not None
    assert [round(float(figure), 1) for figure in found.groups()] == DEPARTURES["reference"][:3]


@pytest.mark.parametrize("line", COMMANDS)
def test_a_command_has_the_flags_that_the_readme_gives_it(line: str) -> None:
    _, _, module, *words = shlex.split(line)
    shown = subprocess.run(
        [sys.executable, "-m", module, "--help"], capture_output=True, text=True, check=True
    ).stdout
    for word in words:
        if word.startswith("--"):
            assert re.search(rf"{word}\b", shown), word


def test_pictures_and_named_modules_exist() -> None:
    for path in re.findall(r"\]\(([^)]+)\)", README):
        assert (ROOT / path).is_file(), path
    layout = README.split("## Reading the code")[1].split("\n\n")[1]
    named = set(re.findall(r"`(\w+\.py)`", layout))
    modules = {path.name for path in (ROOT / "keras_pendulum").glob("*.py")}
    assert named <= modules
    unnamed = {"__init__.py", "errors.py", "backend.py", "atomic_file.py", "display.py"}
    assert modules - named == unnamed


@pytest.mark.parametrize("name", sorted(path.stem for path in (ROOT / "weights").glob("*.h5")))
def test_a_shipped_policy_repeats_the_return_that_its_file_states(name: str) -> None:
    path = kp.find_weights(name)
    with h5py.File(path) as file:
        stated = dict(file["keras_pendulum"].attrs)
    network = kp.load_weights(path)
    assert stated["preset"] == json.loads(stated["config"])["preset"] == name
    assert stated["seed"] == json.loads(stated["config"])["seed"]
    assert json.loads(stated["versions"]).keys() >= {"tensorflow", "keras", "gymnasium", "numpy"}
    score = kp.evaluate_policy(network)
    assert score.mean_return == pytest.approx(stated["evaluated_return"], abs=0.01)
