"""The order of the rooms: each module imports only from its own room and from those below it."""

from __future__ import annotations

import ast
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

import keras_pendulum

PACKAGE = Path(keras_pendulum.__file__).parent
# From the top down. `__main__` and `diagnose` start commands. The modules at the end have no room;
# every module may import them.
ROOMS = (
    *("exercise", "study", "compare", "diagnosis", "page", "play", "train", "evaluate", "figures"),
    *("optimum", "storage", "config", "dqn", "environments"),
)
WITHOUT_ROOM = (
    *("cli", "completion", "display", "tensorflow_setup", "status"),
    *("history", "limits", "version", "errors"),
)
LIBRARIES_OF_DQN = ("numpy", "keras", "tensorflow")
ORDER = ("__main__", "diagnose", *ROOMS, *WITHOUT_ROOM)


def imports(path: Path) -> Iterator[str]:
    """Yields what a file imports, such as `numpy` or `keras_pendulum.dqn.network.DQN`."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def imported_modules(path: Path, package: Path = PACKAGE) -> Iterator[str]:
    """Yields the modules of the package that a file imports, such as `dqn.network`."""
    for name in imports(path):
        parts = name.split(".")
        if parts[0] == "keras_pendulum":
            # Drops the imported name: `dqn.network.DQN` becomes `dqn.network`.
            while parts[1:] and not is_module(package, parts[1:]):
                parts.pop()
            yield ".".join(parts[1:])


def is_module(package: Path, parts: list[str]) -> bool:
    path = package.joinpath(*parts)
    return path.is_dir() or path.with_suffix(".py").is_file()


def module_name(path: Path, package: Path = PACKAGE) -> str:
    return ".".join(path.relative_to(package).with_suffix("").parts)


def problems(package: Path = PACKAGE) -> list[str]:
    """Returns a line for each upward or circular import of a package."""
    found: list[str] = []
    imported: dict[str, set[str]] = {}
    for path in sorted(package.rglob("*.py")):
        name = module_name(path, package)
        if name == "__init__":  # the public names, from everywhere
            continue
        imported[name] = set(imported_modules(path, package)) - {name}
        room = name.split(".")[0]
        for other in sorted(imported[name]):
            if not other:
                found.append(f"{path.relative_to(package)} imports the package itself")
            elif ORDER.index(other.split(".")[0]) < ORDER.index(room):
                found.append(f"{path.relative_to(package)} imports {other}, which is above it")
    try:
        TopologicalSorter(imported).prepare()
    except CycleError as error:
        found.append(f"circular imports: {' <- '.join(error.args[1])}")
    return found


def test_imports_go_down_the_floor_plan() -> None:
    assert problems() == []


def test_every_module_has_a_place_in_the_floor_plan() -> None:
    rooms = {path.parent.name for path in PACKAGE.glob("*/__init__.py")}
    assert rooms == set(ROOMS)
    without_room = {path.stem for path in PACKAGE.glob("*.py")} - {"__init__"}
    assert without_room == {"__main__", "diagnose", *WITHOUT_ROOM}


def test_dqn_imports_nothing_else_of_the_package_or_of_others() -> None:
    for path in (PACKAGE / "dqn").glob("*.py"):
        for name in imports(path):
            known = name.partition(".")[0] in (*sys.stdlib_module_names, *LIBRARIES_OF_DQN)
            assert known or name.startswith("keras_pendulum.dqn."), f"{path.name}: {name}"


def test_few_places_ask_which_task_it_is() -> None:
    question = re.compile(
        r"isinstance\([^)]*(Pendulum|CartPole)\)|environment [!=]= \"|\.gravity is (not )?None"
    )
    places = [
        f"{path.relative_to(PACKAGE)}: {line.strip()}"
        for path in sorted(PACKAGE.rglob("*.py"))
        if path.parent.name != "environments"
        for line in path.read_text(encoding="utf-8").splitlines()
        if question.search(line)
    ]
    assert len(places) <= 5, places


def test_rooms_have_an_empty_init() -> None:
    assert [path for path in PACKAGE.glob("*/__init__.py") if path.read_text() != ""] == []


# Files, each with a wrong import, and its problem.
WRONG = {
    "dqn/agent.py": (
        "from keras_pendulum.train.loop import train_episodes",
        "dqn/agent.py imports train.loop, which is above it",
    ),
    "errors.py": ("import keras_pendulum.cli", "errors.py imports cli, which is above it"),
    "storage/load_weights.py": (
        "from keras_pendulum import __version__",
        "storage/load_weights.py imports the package itself",
    ),
    "play/window.py": (
        "from keras_pendulum.play import __main__",
        "circular imports: play.__main__ <- play.window <- play.__main__",
    ),
}


@pytest.mark.parametrize("file", WRONG)
def test_wrong_import_is_reported_with_its_file(file: str, tmp_path: Path) -> None:
    line, problem = WRONG[file]
    package = shutil.copytree(PACKAGE, tmp_path / "package")
    with (package / file).open("a", encoding="utf-8") as changed:
        changed.write(f"\n{line}\n")
    assert problem in problems(package)


USES = """
import runpy, sys
import keras_pendulum as kp
from keras_pendulum.__main__ import main

try:
    import keras_pendulum.diagnose
except ImportError as error:
    assert "from keras_pendulum import diagnose" in str(error)
else:
    raise SystemExit("imported")
assert main(["diagnose", "nothing.h5"]) == 2
sys.argv = ["diagnose", "nothing.h5"]
try:
    runpy.run_module("keras_pendulum.diagnose", run_name="__main__", alter_sys=True)
except SystemExit as exit:
    assert exit.code == 2
from keras_pendulum import diagnose
assert callable(diagnose) and diagnose is kp.diagnose
"""


def test_function_is_not_hidden_by_the_command_of_its_name() -> None:
    subprocess.run([sys.executable, "-c", USES], check=True)
