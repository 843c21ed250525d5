""".github/workflows/ci.yml, which only a public host can run: its systems, Pythons and commands."""

from __future__ import annotations

from typing import Any

import pytest
import yaml
from conftest import ROOT
from test_dependencies import PYTHONS
from test_readme import fenced

WORKFLOW = yaml.safe_load((ROOT / ".github" / "workflows" / "ci.yml").read_text(encoding="utf-8"))
JOB = WORKFLOW["jobs"]["quick"]


def commands(system: str) -> list[str]:
    """Returns the commands that run on a system of the workflow."""
    conditions = {None, f"runner.os {'==' if system == 'Windows' else '!='} 'Windows'"}
    return [
        line
        for step in JOB["steps"]
        if "run" in step and step.get("if") in conditions
        for line in step["run"].splitlines()
    ]


def test_matrix_has_each_system_and_the_first_and_last_python() -> None:
    matrix: dict[str, Any] = JOB["strategy"]["matrix"]
    assert matrix["os"] == ["ubuntu-latest", "ubuntu-24.04-arm", "macos-latest", "windows-latest"]
    assert matrix["python"] == [PYTHONS[0], PYTHONS[-1]]
    assert JOB["runs-on"] == "${{ matrix.os }}"
    (setup,) = [step for step in JOB["steps"] if "setup-python" in step.get("uses", "")]
    assert setup["with"] == {"python-version": "${{ matrix.python }}"}


@pytest.mark.parametrize("system", ["Linux", "Windows"])
def test_commands_are_the_first_line_of_the_readme_and_the_quick_tests(system: str) -> None:
    if system == "Linux":
        first = fenced("sh")[0].splitlines()
    else:
        # The workflow has set up one Python, which the launcher `py` need not know.
        first = fenced("bat")[0].replace("py -3.13", "python").splitlines()
    first[-1] += " --episodes 60"
    assert commands(system) == [
        *first,
        'python -m pip install -q -e ".[test]"',
        "python -m pytest -m quick",
    ]
