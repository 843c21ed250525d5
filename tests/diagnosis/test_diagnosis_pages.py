"""The pages on the diagnosis: no fault is missing."""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path

from conftest import ROOT

import keras_pendulum as kp
from benchmarks.diagnosis.labelled_networks import FAULTS
from benchmarks.diagnosis.stranger_programs import MISTAKES
from benchmarks.pages.fault_pictures import PICTURES, picture_cases
from keras_pendulum.diagnosis.faults import FAULTS as TEXTS
from keras_pendulum.dqn.exploration import epsilon_by_episodes

DIAGNOSE = (ROOT / "docs" / "diagnose.md").read_text(encoding="utf-8")
LEARN = (ROOT / "docs" / "my_dqn_does_not_learn.md").read_text(encoding="utf-8")


def sections(page: str) -> set[str]:
    return set(re.findall(r"^### ([a-z-]+)$", page, re.MULTILINE))


def test_every_finding_has_a_section_and_a_row() -> None:
    assert sections(LEARN) == set(TEXTS) > set(FAULTS)
    table = DIAGNOSE.split("## The findings")[1].split("##")[0]
    assert set(re.findall(r"my_dqn_does_not_learn\.md#([a-z-]+)", table)) == set(TEXTS)


def test_every_variant_has_a_row() -> None:
    rows = set(re.findall(r"^\| `([a-z-]+)` \|", LEARN, re.MULTILINE))
    named = {mistake.variant for mistake in MISTAKES.values()} - {""}
    heads = {"softmax", "tanh", "sigmoid", "relu"}
    assert rows == named - heads | {"forgot", "jumps", "lasting-actions"}
    assert all(head in LEARN.lower() for head in heads)


def test_page_says_when_epsilon_of_the_reference_falls() -> None:
    config = kp.preset()
    schedule = partial(
        epsilon_by_episodes, config.epsilon_start, config.epsilon_decay, config.epsilon_min
    )
    epsilons = [schedule(episode, 0) for episode in range(config.episodes)]
    below = next(episode for episode, epsilon in enumerate(epsilons) if epsilon < 0.1)
    lowest = epsilons.index(config.epsilon_min)
    said = f"below 0.1 from episode {below} on, and reaches 0.01 in episode {lowest} of 500"
    assert config.episodes == 500 and config.epsilon_min == 0.01
    assert said in " ".join(LEARN.split())


def test_every_fault_has_a_small_picture() -> None:
    shown = re.findall(r"!\[[^]]+\]\((faults/[a-z-]+\.png)\)", LEARN)
    assert sorted(shown) == sorted(f"faults/{name}.png" for name in picture_cases())
    files = sorted(PICTURES.iterdir())
    assert [path.name for path in files] == sorted(Path(name).name for name in shown)
    assert max(path.stat().st_size for path in files) < 100_000
