"""The pages on the diagnosis: no fault is missing."""

from __future__ import annotations

import re
from pathlib import Path

from conftest import ROOT

from benchmarks.diagnosis.labelled_networks import FAULTS
from benchmarks.pages.fault_pictures import PICTURES, picture_cases
from keras_pendulum.diagnosis.faults import FAULTS as TEXTS

DIAGNOSE = (ROOT / "docs" / "diagnose.md").read_text(encoding="utf-8")
LEARN = (ROOT / "docs" / "my_dqn_does_not_learn.md").read_text(encoding="utf-8")


def sections(page: str) -> set[str]:
    return set(re.findall(r"^### ([a-z-]+)$", page, re.MULTILINE))


def test_every_finding_has_a_section() -> None:
    assert sections(DIAGNOSE) == set(TEXTS)
    assert sections(LEARN) == set(FAULTS) == set(TEXTS) - {"undetermined"}


def test_every_fault_has_a_small_picture() -> None:
    shown = re.findall(r"!\[[^]]+\]\((faults/[a-z-]+\.png)\)", LEARN)
    assert sorted(shown) == sorted(f"faults/{name}.png" for name in picture_cases())
    files = sorted(PICTURES.iterdir())
    assert [path.name for path in files] == sorted(Path(name).name for name in shown)
    assert max(path.stat().st_size for path in files) < 100_000
