"""README.md and docs: each measured figure is in a block that is made from a result."""

from __future__ import annotations

import json
import re
from pathlib import Path

import h5py
import pytest
from conftest import ROOT

import keras_pendulum as kp
from benchmarks.learning.departures import BEFORE, departures
from benchmarks.learning.regrets import STATISTIC, number
from benchmarks.learning.study import table
from benchmarks.pages.blocks import BLOCKS, documents
from benchmarks.pages.preset_blocks import printed_by, with_bad_runs
from benchmarks.pages.reasons import REASONS
from benchmarks.tables import block_names, rewrite, without_blocks

DOCUMENTS = list(documents())
# Decimal numbers, and whole ones with a unit of a measurement.
MEASURED = re.compile(
    r"(?<![\w.])\d+\.\d+"
    r"|(?<![\w.])\d[\d ]*?(?= ?(?:%|s|seconds|ms|µs|[MGk]i?B|times|hours?|minutes?|runs per)(?!\w))"
)
# Versions, settings, limits in the code, and the 95 % of an interval.
CONSTANTS = {
    *("3.11", "3.12", "3.13", "3.14", "2.21", "2.15", "2.16", "0.1", "95"),  # versions, interval
    *("0.9", "0.98", "0.985", "0.01", "0.004", "1e-7"),  # discounts, ε, weight decays
    *("2.5", "0.0", "0.00"),  # an error message, and a regret below zero
    *("1", "1.0", "1.00", "0.3", "0.35", "0.8", "0.85", "0.97", "0.99"),  # rules of diagnose
    *("2", "8", "32", "48", "4.5", "4"),  # docs/files.md and docs/scaling.md: limits, sizes
}


def prose(page: Path) -> str:
    """Returns a page without its blocks, its code and its links' targets."""
    text = without_blocks(page.read_text(encoding="utf-8"))
    for left_out in (r"^```.*?^```$", r"`[^`\n]*`", r"\]\([^)]*\)"):
        text = re.sub(left_out, "", text, flags=re.MULTILINE | re.DOTALL)
    return text


@pytest.mark.parametrize("page", DOCUMENTS, ids=lambda path: path.name)
def test_blocks_are_made_from_the_present_results(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert text == rewrite(text), "run `python -m benchmarks.tables`"


@pytest.mark.parametrize("page", DOCUMENTS, ids=lambda path: path.name)
def test_figure_outside_the_blocks_is_a_constant(page: Path) -> None:
    assert {match.group() for match in MEASURED.finditer(prose(page))} <= CONSTANTS


def test_figure_in_prose_is_found() -> None:
    found = MEASURED.findall("takes 12 s, regret 1.08, 20 times as fast, 3 % of 41 torques, v2")
    assert found == ["12", "1.08", "20", "3"]


def test_each_block_is_shown() -> None:
    names = [name for page in DOCUMENTS for name in block_names(page.read_text(encoding="utf-8"))]
    assert set(names) == set(BLOCKS)


def test_rewrite_replaces_a_stale_block_only() -> None:
    start = "<!-- quality: python -m benchmarks.tables -->"
    text = f"before 1.5\n\n{start}\nstale\n<!-- end -->\n\nafter\n"
    new = rewrite(text)
    assert new == text.replace("stale\n", BLOCKS["quality"]())
    assert rewrite(new) == new


@pytest.mark.parametrize("arm", ["original", "reference"])
def test_all_pages_show_one_regret_of_a_preset(arm: str) -> None:
    row = next(row for row in table()["rows"] if row["arm"] == arm)
    regret = number(row["regret_iqm"])
    interval = f"{number(row['regret_low'])} to {number(row['regret_high'])}"
    assert f"| {regret} | {interval} |" in BLOCKS["story"]()
    assert re.search(rf" {regret} (for the original|\()", BLOCKS["steps"]())
    assert f"| {arm} | {regret} | {interval} |" in BLOCKS["study"]()
    assert f"| {regret} | {interval} |" in BLOCKS["quality"]()
    assert f"- `{arm}`: {regret} ({interval}), worst" in BLOCKS["departures of reference"]()


@pytest.mark.parametrize("block", ["steps", "quality"])
def test_page_says_once_what_its_regrets_are(block: str) -> None:
    (page,) = [page for page in DOCUMENTS if f"<!-- {block}: " in page.read_text("utf-8")]
    assert page.read_text("utf-8").count("interquartile mean") == 1
    assert STATISTIC in BLOCKS[block]()


def test_runs_above_zero_are_counted_where_most_runs_lose_nothing() -> None:
    shown = with_bad_runs([0.0] * 9 + [20.0])
    assert shown.startswith("0.00 (0.00 to ")
    assert shown.endswith("), worst 20.0, 1 of 10 runs above 0")


@pytest.mark.parametrize("preset", BEFORE)
def test_each_departure_has_a_reason(preset: str) -> None:
    assert set(REASONS[preset]) == set(departures(preset))


def test_printed_score_is_that_of_the_shipped_policy() -> None:
    score = kp.evaluate_policy("reference")
    printed = " ".join(printed_by("evaluate reference"))
    for words, figure in {
        "mean return": score.mean_return,
        "Best possible on the same starts:": score.optimal_mean_return,
        "Regret:": score.regret,
    }.items():
        found = re.search(rf"{words} (-?[\d.]+)", printed)
        assert found is not None
        # Floating-point rounding of another processor may change an action.
        assert float(found.group(1)) == pytest.approx(figure, abs=0.015)


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
