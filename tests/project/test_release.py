"""The version in CITATION.cff and CHANGELOG.md, and the settings that have another name."""

from __future__ import annotations

import re

import yaml
from conftest import ROOT

import keras_pendulum as kp
from keras_pendulum.config.settings import RENAMED

CHANGELOG = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def test_citation_has_the_fields_of_its_format_and_the_version() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    # The fields that version 1.2.0 of the format requires.
    assert citation.keys() >= {"cff-version", "message", "title", "authors"}
    assert citation["cff-version"] == "1.2.0"
    assert citation["authors"] == [{"name": "keras_pendulum maintainers"}]
    assert citation["version"] == kp.__version__
    assert re.findall(r"^## (.+)$", CHANGELOG, re.MULTILINE)[0] == (
        f"{kp.__version__} ({citation['date-released']})"
    )


def test_changelog_dates_each_version() -> None:
    headings = re.findall(r"^## (.+)$", CHANGELOG, re.MULTILINE)
    dates = [re.fullmatch(r"\d+\.\d+\.\d+ \((\d{4}-\d\d-\d\d)\)", each) for each in headings]
    assert all(dates)
    assert headings == sorted(headings, reverse=True)


def test_changelog_has_each_renamed_setting() -> None:
    rows = dict(re.findall(r"^\| `(\w+)` \| `(\w+)`", CHANGELOG, re.MULTILINE))
    assert rows == {old: new.split(" ")[0] for old, new in RENAMED.items()}
