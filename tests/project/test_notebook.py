"""Tests of examples/step_by_step.ipynb: its cells print what it says, and its page is the same."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path
from typing import Any

import nbformat
import pytest

from benchmarks.pages.notebook import NOTEBOOK, PAGE, execute, page_of


@pytest.fixture(scope="module")
def stored() -> Any:
    """Returns the notebook as it ships."""
    return nbformat.read(NOTEBOOK, as_version=4)  # type: ignore[no-untyped-call]


@pytest.fixture(scope="module")
def executed(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Returns the notebook with its outputs after few steps, executed in an empty folder.

    `python -m benchmarks.pages.notebook` makes the stored outputs, with all steps.
    """
    notebook: Any = nbformat.read(NOTEBOOK, as_version=4)  # type: ignore[no-untyped-call]
    for cell in notebook.cells:
        cell.source = re.sub(r"^STEPS = [\d_]+", "STEPS = 1_200", cell.source, flags=re.MULTILINE)
    # With the first one, the kernel would not show what C++ code prints, with the other one no
    # pictures. Tests in the same process may have set them.
    unwanted = ("PYTEST_CURRENT_TEST", "MPLBACKEND")
    environment = {name: value for name, value in os.environ.items() if name not in unwanted}
    execute(notebook, tmp_path_factory.mktemp("notebook"), env=environment)
    return notebook


def printed(notebook: Any) -> list[str]:
    """Returns the lines that the cells print."""
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    texts = [output.text for output in outputs if output.output_type == "stream"]
    return "".join(texts).splitlines()


def figures(notebook: Any) -> dict[str, float]:
    """Returns the number at the end of each line by the words before it."""
    return {
        words: float(number)
        for words, number in (line.rsplit(" ", 1) for line in printed(notebook))
    }


def test_each_part_is_better_than_the_run_without_it(stored: Any) -> None:
    regrets = {words.removesuffix(": regret"): number for words, number in figures(stored).items()}
    complete = regrets["complete program"]
    assert complete < 60
    for without in ("without replay", "without target", "random actions only"):
        assert regrets[without] > 5 * complete, without
    assert regrets["without random actions"] > complete
    assert regrets["Regret of the network:"] < 60
    assert regrets["Regret of the table of cells:"] > 500
    assert (
        regrets["Regret of the highest next reward:"] > 0.9 * regrets["Regret of random torques:"]
    )


def test_table_is_nearly_perfect_after_100_sweeps_of_the_right_discount(stored: Any) -> None:
    regrets = figures(stored)
    assert regrets["Sweep 100: regret"] < 10 < 100 < regrets["Sweep 10: regret"]
    discounts = [regrets[f"γ = {gamma}: regret"] for gamma in (0.5, 0.9, 0.985)]
    assert discounts == sorted(discounts, reverse=True)


def test_executed_cells_print_the_stored_figures_of_the_exact_parts(
    executed: Any, stored: Any
) -> None:
    trained = ("complete", "without", "random actions", "Regret of the network")
    shown = figures(stored)
    found = {words: number for words, number in figures(executed).items() if words in shown}
    assert found.keys() == shown.keys()
    for words, number in found.items():
        if not words.startswith(trained):
            # Floating-point rounding of another processor may change an action.
            assert number == pytest.approx(shown[words], rel=0.02, abs=0.5), words


def test_no_cell_prints_an_error_or_a_note_of_tensorflow(executed: Any) -> None:
    outputs = [output for cell in executed.cells for output in cell.get("outputs", [])]
    assert [output.text for output in outputs if output.get("name") == "stderr"] == []


def test_stored_outputs_are_of_the_kinds_that_the_cells_make(executed: Any, stored: Any) -> None:
    def kinds(notebook: Any) -> list[list[str]]:
        cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
        # On a busy machine, a text may arrive after the picture that follows it.
        return [sorted(output.output_type for output in cell.outputs) for cell in cells]

    assert kinds(stored) == kinds(executed)


def test_page_has_the_cells_and_outputs_of_the_notebook(stored: Any) -> None:
    page, pictures = page_of(stored)
    assert PAGE.read_text(encoding="utf-8") == page, "run `python -m benchmarks.pages.notebook`"
    folder = PAGE.with_suffix("")
    assert {
        f"{folder.name}/{path.name}": path.read_bytes() for path in folder.iterdir()
    } == pictures


def test_notebook_imports_public_names_only(stored: Any) -> None:
    code = "\n".join(cell.source for cell in stored.cells if cell.cell_type == "code")
    assert re.findall(r"keras_pendulum\S*", code) == ["keras_pendulum"]


def test_stored_notebook_is_small_and_knows_no_machine() -> None:
    text = NOTEBOOK.read_text(encoding="utf-8")
    assert len(text) < 600_000
    without_pictures = re.sub(r'"image/png": "[^"]*"', "", text)
    assert str(Path.home()) not in without_pictures
    # Paths, addresses of objects, and times of the execution.
    assert re.findall(r"/(?:tmp|home|work|usr|root)/|0x[0-9a-f]{6}|\.py:\d", without_pictures) == []
    cells = json.loads(text)["cells"]
    assert all(cell["metadata"] == {} for cell in cells)
