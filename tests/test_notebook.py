"""The notebook runs from its first cell to its last, and shows what it says."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbclient import NotebookClient

TOUR = Path(__file__).parents[1] / "notebooks" / "tour.ipynb"


@pytest.fixture(scope="module")
def tour(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """The notebook with its outputs, run in an empty folder."""
    notebook = nbformat.read(TOUR, as_version=4)  # type: ignore[no-untyped-call]
    folder = str(tmp_path_factory.mktemp("tour"))
    NotebookClient(notebook, timeout=300, resources={"metadata": {"path": folder}}).execute()
    return notebook


def printed(cell: Any) -> str:
    return "".join(output.text for output in cell.outputs if output.output_type == "stream")


def test_the_tour_goes_from_the_original_to_agents_that_work(tour: Any) -> None:
    text = "\n".join(printed(cell) for cell in tour.cells if cell.cell_type == "code")
    original, reference = (float(figure) for figure in re.findall(r"Regret: (.*)", text))
    assert original > 500
    assert reference < 8
    returns = [float(figure) for figure in re.findall(r"CartPole-v1: mean return (\S+)", text)]
    assert returns[-1] == 500.0


def test_the_indices_that_truncation_loses_are_shown(tour: Any) -> None:
    (cell,) = (cell for cell in tour.cells if cell.source.startswith("wrong ="))
    assert cell.outputs[0].data["text/plain"] == "{2: 1, 4: 3}"


def test_the_live_plot_is_one_picture_redrawn_in_place(tour: Any) -> None:
    (cell,) = (cell for cell in tour.cells if "LivePlot()" in cell.source)
    # The run takes many times as long as two drawings are apart.
    assert len([output for output in cell.outputs if output.output_type == "display_data"]) == 1


def test_the_file_holds_no_outputs(tour: Any) -> None:
    stored = nbformat.read(TOUR, as_version=4)  # type: ignore[no-untyped-call]
    assert not any(cell.get("outputs") for cell in stored.cells)
