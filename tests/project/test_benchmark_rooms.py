"""The rooms of benchmarks/: imports go one way, and every module that is named exists."""

from __future__ import annotations

import re
from collections.abc import Iterator

import pytest
from conftest import ROOT
from test_floor_plan import imports

BENCHMARKS = ROOT / "benchmarks"
MODULES = {
    ".".join(path.relative_to(BENCHMARKS).with_suffix("").parts): path.read_text(encoding="utf-8")
    for path in BENCHMARKS.rglob("*.py")
    if path.name != "__init__.py"
}
COMMANDS = {name for name, text in MODULES.items() if '__name__ == "__main__"' in text}
# From the top down: what writes into the pages reads the results of what measures.
ORDER = (
    "tables",
    "pages",
    "diagnosis",
    "learning",
    "speed",
    "files",
    "recorded_runs",
    "result_files",
)
NAMING = (
    *("*.md", "docs/*.md", "benchmarks/results/*.md", "benchmarks/results/*.json"),
    *("benchmarks/**/*.py", "keras_pendulum/**/*.py", "tests/torch/*.py"),
)


@pytest.mark.parametrize("module", MODULES)
def test_imports_go_down_the_rooms(module: str) -> None:
    own = ORDER.index(module.split(".")[0])
    for name in imports(BENCHMARKS / f"{module.replace('.', '/')}.py"):
        if name.startswith("benchmarks."):
            assert ORDER.index(name.split(".")[1]) >= own, f"{module} imports {name}"


def test_rooms_have_an_empty_init() -> None:
    inits = list(BENCHMARKS.glob("*/__init__.py"))
    assert {path.parent.name for path in inits} == {name for name in ORDER if name not in MODULES}
    assert [path for path in inits if path.read_text(encoding="utf-8") != ""] == []


def wrong_names(text: str) -> Iterator[str]:
    """Yields the modules of benchmarks/ that a text names and that do not exist."""
    for name in re.findall(r"-m benchmarks\.([\w.]*\w)", text):
        if name not in COMMANDS:
            yield name
    for name in re.findall(r"\bbenchmarks/([\w/]+)\.py\b", text):
        if name.replace("/", ".") not in MODULES:
            yield name
    for name in re.findall(r"(?<![\w/])benchmarks\.(?!md\b)(\w+(?:\.\w+)*)", text):
        # The end may be a function.
        if not {name, name.rpartition(".")[0]} & {*MODULES, *ORDER}:
            yield name


def test_every_named_module_exists() -> None:
    paths = [path for pattern in NAMING for path in ROOT.glob(pattern)]
    texts = {path.relative_to(ROOT): path.read_text(encoding="utf-8") for path in paths}
    assert [(path, name) for path, text in texts.items() for name in wrong_names(text)] == []


@pytest.mark.parametrize(
    "text", ["python -m benchmarks.quality", "benchmarks/faults.py", "`benchmarks.report.write`"]
)
def test_name_of_a_missing_module_is_found(text: str) -> None:
    assert list(wrong_names(text))


def test_page_lists_every_command() -> None:
    page = (ROOT / "docs" / "benchmarks.md").read_text(encoding="utf-8")
    # Another benchmark starts the other libraries.
    listed = set(re.findall(r"-m benchmarks\.([\w.]*\w)", page))
    assert listed == COMMANDS - {"learning.other_libraries"}
