"""The values that the Tab key offers, also as a shell asks for them."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

import keras_pendulum as kp
from keras_pendulum.__main__ import COMMANDS
from keras_pendulum.completion import names, names_with_commas, paths, weights_files
from keras_pendulum.config.presets import PRESETS

PACKAGE = Path(kp.__file__).parent
SHIPPED = {path.stem for path in (PACKAGE.parent / "weights").glob("*.h5")}
MODULE = "python -m keras_pendulum"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a run, a picture and a hidden folder; the process is in it."""
    (tmp_path / "runs" / "one").mkdir(parents=True)
    (tmp_path / ".cache").mkdir()
    for name in ("mine.h5", "model.keras", "picture.png", "runs/one/pendulum_weight.h5"):
        (tmp_path / name).touch()
    monkeypatch.chdir(tmp_path)
    return tmp_path


def completions(line: str, folder: Path) -> set[str]:
    """Returns what the shell offers at the end of a line."""
    program = line.split()[:3] if line.startswith("python") else line.split()[:1]
    file = folder / "completions.txt"
    variables = {  # those that argcomplete's shell functions set
        "_ARGCOMPLETE": str(len(program)),
        "_ARGCOMPLETE_IFS": "\n",
        "_ARGCOMPLETE_STDOUT_FILENAME": str(file),
        "COMP_LINE": line,
        "COMP_POINT": str(len(line)),
    }
    words = ["-m", program[2]] if len(program) == 3 else ["-c", SCRIPT]
    subprocess.run(
        [sys.executable, *words],
        cwd=folder,
        env=os.environ | variables,
        capture_output=True,
        check=True,
    )
    offered = {word.strip() for word in file.read_text(encoding="utf-8").split("\n")}
    file.unlink()
    return offered


# What pip's script `keras-pendulum` contains.
SCRIPT = "import sys; from keras_pendulum.__main__ import main; sys.exit(main())"


@pytest.mark.parametrize(
    ("line", "offered"),
    [
        (f"{MODULE}.train --tar", {"--target-update", "--target-period"}),  # hidden by --help
        (f"{MODULE}.train --target-b", {""}),  # an old name
        (f"{MODULE}.train --preset ", set(PRESETS)),
        (f"{MODULE}.train --preset=s", {"--preset=swingup"}),
        (f"{MODULE}.train --loss ", {"squared", "huber"}),
        (f"{MODULE}.train --double-q t", {"true"}),
        (f"{MODULE}.train --init ", {*SHIPPED, "mine.h5", "model.keras", "runs/"}),
        (f"{MODULE}.train --out r", {"runs/"}),
        (f"{MODULE}.evaluate --gi", {"--gif"}),
        (f"{MODULE}.evaluate runs/one/", {"runs/one/pendulum_weight.h5"}),
        (f"{MODULE}.play --against sw", {"swingup"}),
        (f"{MODULE}.page m", {"mine.h5", "model.keras"}),
        (f"{MODULE}.compare runs/", {"runs/one/"}),
        (f"{MODULE}.study --presets reference,w", {"reference,walkthrough"}),
        (f"{MODULE} tr", {"train"}),
        ("keras-pendulum ", {*COMMANDS, "-h", "--help", "--version"}),
        ("keras-pendulum evaluate orig", {"original"}),
        ("keras-pendulum train --preset cartpole --los", {"--loss"}),
    ],
)
def test_shell_completes_commands_flags_and_values(
    line: str, offered: set[str], folder: Path
) -> None:
    assert completions(line, folder) == offered


@pytest.mark.parametrize("name", ["", *COMMANDS])
def test_shell_finds_the_mark_of_each_command(name: str) -> None:
    file = "diagnose.py" if name == "diagnose" else Path(name, "__main__.py")
    source = (PACKAGE / file).read_text(encoding="utf-8")
    assert "PYTHON_ARGCOMPLETE_OK" in source[:1024]


def test_names_with_commas_are_offered_once() -> None:
    complete = names_with_commas(("one", "two", "three"))
    assert complete("") == ["one", "two", "three"]
    assert complete("one,t") == ["one,two", "one,three"]
    assert complete("one,two,") == ["one,two,three"]
    assert names(("one", "two"))("t") == ["two"]


def test_folders_and_weights_files_are_offered_with_their_path(folder: Path) -> None:
    assert paths("") == ["runs/"]
    assert paths(".c") == [".cache/"]
    assert paths(f"{folder}/ru") == [f"{folder}/runs/"]
    assert paths("no/such/folder/") == []
    assert weights_files(lambda: ["model"])("mo") == ["model", "model.keras"]


def test_home_folder_is_completed_as_it_is_typed(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", str(folder))
    monkeypatch.setenv("USERPROFILE", str(folder))
    assert paths("~/ru") == ["~/runs/"]
