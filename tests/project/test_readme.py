"""README.md: its length, its lines for each system, its commands and its map of the rooms."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
from conftest import ROOT, Command
from test_dependencies import PYTHONS, WITHOUT_WHEELS
from test_floor_plan import ROOMS, imported_modules

import keras_pendulum as kp
from benchmarks.pages.blocks import documents
from benchmarks.pages.code_blocks import DQN_FILES

PACKAGE = Path(kp.__file__).parent

README = (ROOT / "README.md").read_text(encoding="utf-8")
INSTALL = ROOT / "docs" / "install.md"
DOCUMENTS = sorted({*ROOT.glob("*.md"), *documents()})
COMMANDS = sorted(
    {
        match.strip()
        for page in DOCUMENTS
        for match in re.findall(
            r"python -m keras_pendulum\.[^\n`#&|…]+", page.read_text(encoding="utf-8")
        )
    }
)


def fenced(language: str, document: Path = ROOT / "README.md") -> list[str]:
    """Returns the blocks of a language in a document, each without the newline at its end."""
    text = document.read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)\n```$", text, re.MULTILINE | re.DOTALL)


def test_readme_is_short() -> None:
    assert len(README.splitlines()) <= 130
    assert len(README.split()) <= 1100


def test_readme_has_the_first_line_of_each_system_and_the_line_of_the_tests() -> None:
    assert fenced("sh") == fenced("sh", INSTALL)
    assert fenced("bat") == fenced("bat", INSTALL)[:1]


def test_lines_for_windows_are_the_two_lines() -> None:
    for line, block in zip(fenced("sh"), fenced("bat", INSTALL), strict=True):
        # `.ci/run` finds the line of the tests by its `-m pytest`.
        for ours, theirs in (
            ("python3 ", "py -3.13 "),
            ("/bin/", "\\Scripts\\"),
            ("python -m pytest", "pytest"),
        ):
            line = line.replace(ours, theirs)
        assert block.splitlines() == line.split(" && ")


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_shell_lines_have_double_quotes_only(document: Path) -> None:
    # The command prompt of Windows passes single quotes on.
    for block in fenced("(?:sh|bat)", document):
        assert "'" not in re.sub(r" #.*", "", block)


def test_pythons_and_systems_are_those_of_the_dependencies() -> None:
    *others, last = PYTHONS
    for text in (README, INSTALL.read_text(encoding="utf-8")):
        assert f"Python {', '.join(others)} or {last} on Linux" in " ".join(text.split())
    for system in ("Python 3.14", *WITHOUT_WHEELS):
        assert f"**{system}" in text.replace("\n", " ")


@pytest.mark.parametrize("line", COMMANDS)
def test_command_has_the_flags_that_the_pages_use(line: str, in_process: Command) -> None:
    _, _, module, *words = shlex.split(line)
    name = module.removeprefix("keras_pendulum.")
    shown = in_process(name, "--help-all" if name == "train" else "--help").stdout
    for word in words:
        if word.startswith("--"):
            assert re.search(rf"{word.partition('=')[0]}\b", shown), word


def test_map_of_rooms_is_complete_and_in_the_order_of_imports() -> None:
    assert re.findall(r"^\| `(\w+)/` \|", README, re.MULTILINE) == list(ROOMS)


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_files_that_a_page_names_exist(document: Path) -> None:
    text = document.read_text(encoding="utf-8")
    for name in re.findall(r"`([a-z_]+/(?:\w+/)*\w+\.(?:py|h5|js))`", text):
        assert (PACKAGE / name).exists() or (ROOT / name).exists() or "runs" in name, name


def test_only_the_dqn_has_at_most_800_lines() -> None:
    lines = [(PACKAGE / name).read_text(encoding="utf-8").splitlines() for name in DQN_FILES]
    assert sum(map(len, lines)) <= 800
    rooms = {"dqn", "train", "config", "environments", "storage", "errors", "history"}
    for name in DQN_FILES:
        imported = imported_modules(PACKAGE / name)
        assert {module.split(".")[0] for module in imported} <= rooms, name
