"""The rooms of benchmarks/: imports go one way, and every module that is named exists."""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Iterator

import pytest
from conftest import ROOT
from test_floor_plan import imports

from benchmarks.commands import COMMANDS as LISTED
from benchmarks.commands import Command
from benchmarks.diagnosis.healthy_networks import COUNTS
from benchmarks.diagnosis.strangers import ROUNDS

BENCHMARKS = ROOT / "benchmarks"
MODULES = {
    ".".join(path.relative_to(BENCHMARKS).with_suffix("").parts): path.read_text(encoding="utf-8")
    for path in BENCHMARKS.rglob("*.py")
    if path.name != "__init__.py"
}
COMMANDS = {name for name, text in MODULES.items() if '__name__ == "__main__"' in text}
# From the top down: what writes into the pages reads the results of what measures.
ORDER = (
    "all",
    "tables",
    "pages",
    "diagnosis",
    "learning",
    "speed",
    "files",
    "recorded_runs",
    "commands",
    "resumable",
    "result_files",
)
# `all` runs the others, and another benchmark starts the other libraries.
NOT_LISTED = {"all", "learning.other_libraries"}
RESULTS = BENCHMARKS / "results"
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


def test_table_of_commands_has_every_module_with_a_main() -> None:
    assert {command.module for command in LISTED} == COMMANDS - NOT_LISTED
    names = [command.name for command in LISTED]
    assert len(names) == len({*names})


def test_each_results_file_is_written_by_one_listed_command() -> None:
    names = [name for command in LISTED for name in command.results]
    assert len(names) == len({*names})
    assert {path.stem for path in RESULTS.glob("*.json")} <= {*names}
    assert {path.stem for path in RESULTS.glob("*.md")} <= {*names}


@pytest.mark.parametrize("command", LISTED, ids=lambda command: command.name)
def test_listed_results_are_those_that_the_module_writes(command: Command) -> None:
    source = MODULES[command.module]
    # `write("NAME", …)`, where {…} may be anything; or a table of the names by preset.
    written = re.findall(r'\bwrite\(\s*f?"([^"]+)"', source)
    patterns = [re.sub(r"\\\{.*?\\\}", r"\\w+", re.escape(name)) for name in written]
    by_preset = dict(re.findall(r'"(\w+)": "(learning\w*)"', source))
    patterns += [name for preset, name in by_preset.items() if preset in command.arguments]
    for name in command.results:
        assert any(re.fullmatch(pattern, name) for pattern in patterns)
    for pattern in patterns:
        assert any(re.fullmatch(pattern, name) for name in command.results)


def test_each_results_file_names_its_machine() -> None:
    for path in RESULTS.glob("*.json"):
        assert " cores of " in json.loads(path.read_text("utf-8"))["machine"], path.name


def test_page_lists_the_commands_in_their_order() -> None:
    page = (ROOT / "docs" / "benchmarks.md").read_text(encoding="utf-8")
    assert re.findall(r"^\| `(python -m benchmarks\..*?)` \|", page, re.MULTILINE) == [
        command.line for command in LISTED
    ]


@pytest.mark.parametrize("module", MODULES)
def test_command_trains_with_at_most_ten_seeds_by_default(module: str) -> None:
    for node in ast.parse(MODULES[module]).body:
        if isinstance(node, ast.FunctionDef) and node.name == "main":
            names = [argument.arg for argument in node.args.args]
            defaults = node.args.defaults
            for name, default in zip(names[len(names) - len(defaults) :], defaults, strict=True):
                if name in ("seeds", "rounds") and ast.literal_eval(default) is not None:
                    assert int(ast.literal_eval(default)) <= 10


def test_networks_to_diagnose_have_at_most_ten_seeds() -> None:
    assert max(*COUNTS.values(), *ROUNDS.values()) <= 10
