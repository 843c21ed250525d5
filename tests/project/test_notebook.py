"""Tests of examples/tour.ipynb: all its cells run, and they print the results that it describes."""

from __future__ import annotations

import os
import re
from typing import Any

import nbformat
import pytest
from conftest import ROOT
from nbclient import NotebookClient

TOUR = ROOT / "examples" / "tour.ipynb"


@pytest.fixture(scope="module")
def tour(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Returns the notebook with its outputs, executed in an empty folder."""
    notebook = nbformat.read(TOUR, as_version=4)  # type: ignore[no-untyped-call]
    folder = str(tmp_path_factory.mktemp("tour"))
    # With this variable, the kernel would not show what C++ code prints.
    environment = {
        name: value for name, value in os.environ.items() if name != "PYTEST_CURRENT_TEST"
    }
    client = NotebookClient(notebook, timeout=300, resources={"metadata": {"path": folder}})
    client.execute(env=environment)
    return notebook


def printed(cell: Any) -> str:
    return "".join(output.text for output in cell.outputs if output.output_type == "stream")


def test_original_does_not_learn_and_the_other_presets_do(tour: Any) -> None:
    text = "\n".join(printed(cell) for cell in tour.cells if cell.cell_type == "code")
    original, reference, _, cartpole = map(float, re.findall(r"Regret: (.*)", text))
    assert original > 500
    assert reference < 8
    assert cartpole == 0
    returns = [float(number) for number in re.findall(r"CartPole-v1: mean return (\S+)", text)]
    assert returns[-1] == 500.0


def test_no_cell_prints_an_error_or_a_note_of_tensorflow(tour: Any) -> None:
    outputs = [output for cell in tour.cells for output in cell.get("outputs", [])]
    assert [output.text for output in outputs if output.get("name") == "stderr"] == []


def test_truncated_indices_are_listed(tour: Any) -> None:
    (cell,) = (cell for cell in tour.cells if cell.source.startswith("truncated ="))
    assert cell.outputs[0].data["text/plain"] == "{2: 1, 4: 3}"


def test_live_plot_is_one_picture_that_is_redrawn(tour: Any) -> None:
    (cell,) = (cell for cell in tour.cells if "LivePlot()" in cell.source)
    # The run takes many times as long as the pause between two drawings.
    assert len([output for output in cell.outputs if output.output_type == "display_data"]) == 1


def test_notebook_is_stored_without_outputs() -> None:
    stored = nbformat.read(TOUR, as_version=4)  # type: ignore[no-untyped-call]
    assert not any(cell.get("outputs") for cell in stored.cells)
