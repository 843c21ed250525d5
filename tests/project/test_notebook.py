"""Tests of examples/tour.ipynb: its cells print what it describes, and it ships with outputs."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path
from typing import Any

import nbformat
import pytest

from benchmarks.pages.notebook import TOUR, execute


@pytest.fixture(scope="module")
def stored() -> Any:
    """Returns the notebook as it ships."""
    return nbformat.read(TOUR, as_version=4)  # type: ignore[no-untyped-call]


@pytest.fixture(scope="module")
def tour(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Returns the notebook with its outputs after few episodes, executed in an empty folder.

    `python -m benchmarks.pages.notebook` makes the stored outputs, with all episodes.
    """
    notebook: Any = nbformat.read(TOUR, as_version=4)  # type: ignore[no-untyped-call]
    for cell in notebook.cells:
        cell.source = re.sub(r'kp\.preset\("([\w-]+)".*?\)', few_episodes, cell.source)
    # With this variable, the kernel would not show what C++ code prints.
    environment = {
        name: value for name, value in os.environ.items() if name != "PYTEST_CURRENT_TEST"
    }
    execute(notebook, tmp_path_factory.mktemp("tour"), env=environment)
    return notebook


def few_episodes(preset: re.Match[str]) -> str:
    # CartPole's pole stays up longer after 100 episodes; the others make their first updates.
    episodes = 100 if preset[1] == "cartpole" else 45
    return f'kp.preset("{preset[1]}", episodes={episodes})'


def printed(notebook: Any) -> str:
    """Returns all that the cells print."""
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    return "\n".join(output.text for output in outputs if output.output_type == "stream")


def cartpole_returns(notebook: Any) -> list[float]:
    return list(map(float, re.findall(r"CartPole-v1: mean return (\S+)", printed(notebook))))


def test_original_does_not_learn_and_the_other_presets_do(stored: Any) -> None:
    original, reference, _, cartpole = map(float, re.findall(r"Regret: (.*)", printed(stored)))
    assert original > 500
    assert reference < 8
    assert cartpole == 0
    assert cartpole_returns(stored)[-1] == 500.0


def test_100_episodes_of_cartpole_learn_better_than_random_actions(tour: Any) -> None:
    assert cartpole_returns(tour)[-1] > 60  # random actions: 22


def test_no_cell_prints_an_error_or_a_note_of_tensorflow(tour: Any) -> None:
    outputs = [output for cell in tour.cells for output in cell.get("outputs", [])]
    assert [output.text for output in outputs if output.get("name") == "stderr"] == []


def test_live_plot_is_one_picture_that_is_redrawn(tour: Any) -> None:
    (cell,) = (cell for cell in tour.cells if "LivePlot(" in cell.source)
    # It is drawn at the first and after the last episode.
    assert len([output for output in cell.outputs if output.output_type == "display_data"]) == 1


def test_stored_outputs_are_of_the_kinds_that_the_cells_make(tour: Any, stored: Any) -> None:
    def kinds(notebook: Any) -> list[list[str]]:
        cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
        return [[output.output_type for output in cell.outputs] for cell in cells]

    assert kinds(stored) == kinds(tour)


def test_stored_notebook_is_small_and_knows_no_machine() -> None:
    text = TOUR.read_text(encoding="utf-8")
    assert len(text) < 600_000
    without_pictures = re.sub(r'"image/png": "[^"]*"', "", text)
    assert str(Path.home()) not in without_pictures
    # Paths, addresses of objects, and times of the execution.
    assert re.findall(r"/(?:tmp|home|work|usr|root)/|0x[0-9a-f]{6}|\.py:\d", without_pictures) == []
    cells = json.loads(text)["cells"]
    assert all(cell["metadata"] == {} for cell in cells)
