"""The pages on the diagnosis: their tables are measured, and no fault is missing."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from conftest import ROOT

from benchmarks.fault_pictures import PICTURES, picture_cases
from benchmarks.labelled_networks import FAULTS
from benchmarks.report import RESULTS, markdown
from keras_pendulum.diagnose.texts import TEXTS

DIAGNOSE = (ROOT / "docs" / "diagnose.md").read_text(encoding="utf-8")
LEARN = (ROOT / "docs" / "my_dqn_does_not_learn.md").read_text(encoding="utf-8")


def sections(page: str) -> set[str]:
    return set(re.findall(r"^### ([a-z-]+)$", page, re.MULTILINE))


@pytest.mark.parametrize("name", ["diagnosis", "diagnosis_healthy", "diagnosis_pairs"])
def test_table_is_the_measured_one(name: str) -> None:
    rows = json.loads((RESULTS / f"{name}.json").read_text(encoding="utf-8"))["rows"]
    shown = DIAGNOSE.split(f"benchmarks/results/{name}.json -->\n")[1].split("\n\n")[0] + "\n"
    assert shown == markdown(rows)


def test_every_finding_has_a_section() -> None:
    assert sections(DIAGNOSE) == set(TEXTS)
    assert sections(LEARN) == set(FAULTS) == set(TEXTS) - {"undetermined"}


@pytest.mark.parametrize("page", [DIAGNOSE, LEARN], ids=["diagnose", "learn"])
def test_links_within_a_page_lead_to_its_sections(page: str) -> None:
    headings = re.findall(r"^#+ (.+)$", page, re.MULTILINE)
    anchors = {heading.lower().replace("?", "").replace(" ", "-") for heading in headings}
    assert set(re.findall(r"\]\(#([^)]+)\)", page)) <= anchors
    assert set(re.findall(r"\]\(diagnose\.md#([^)]+)\)", page)) <= set(TEXTS)


def test_every_fault_has_a_small_picture() -> None:
    shown = re.findall(r"!\[[^]]+\]\((faults/[a-z-]+\.png)\)", LEARN)
    assert sorted(shown) == sorted(f"faults/{name}.png" for name in picture_cases())
    files = sorted(PICTURES.iterdir())
    assert [path.name for path in files] == sorted(Path(name).name for name in shown)
    assert max(path.stat().st_size for path in files) < 100_000
