"""Wheel, sdist, editable install and checkout: each finds all files of the package."""

from __future__ import annotations

import ast
import itertools
import json
import os
import re
import shutil
import subprocess
import sys
import tarfile
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

import pytest
from conftest import ROOT
from packaging.requirements import Requirement
from test_dependencies import CONFIG

import keras_pendulum as kp

FILES = (
    *("CHANGELOG.md", "CITATION.cff", "CONTRIBUTING.md", "LICENSE", "MANIFEST.in", "README.md"),
    *("pyproject.toml", "setup.cfg"),
)
FOLDERS = ("benchmarks", "docs", "examples", "keras_pendulum", "tests", "weights")

BUILD = """
from setuptools import build_meta
build_meta.build_sdist("dist")
build_meta.build_wheel("dist")
build_meta.build_editable("editable")
"""


@dataclass(frozen=True)
class Built:
    checkout: Path
    sdist: Path
    wheel: Path
    editable: Path  # a wheel that points to the checkout


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Built:
    """Builds sdist and wheels from a copy of the checkout, without files of earlier builds."""
    checkout = tmp_path_factory.mktemp("checkout")
    for name in FILES:
        shutil.copy(ROOT / name, checkout)
    for name in FOLDERS:
        ignored = shutil.ignore_patterns("__pycache__", "_build")
        shutil.copytree(ROOT / name, checkout / name, ignore=ignored)
    succeed([sys.executable, "-c", BUILD], checkout, "the build failed")
    (sdist,) = checkout.glob("dist/*.tar.gz")
    (wheel,) = checkout.glob("dist/*.whl")
    (editable,) = checkout.glob("editable/*.whl")
    return Built(checkout, sdist, wheel, editable)


@pytest.fixture(scope="module")
def new_python(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Creates a virtual environment with the declared dependencies, linked to the installed ones.

    It has no other package: a dependency that is not declared is missing.
    """
    folder = tmp_path_factory.mktemp("new")
    succeed(
        [sys.executable, "-m", "venv", "--without-pip", "environment"], folder, "no environment"
    )
    python = folder / "environment" / "bin" / "python"
    site = "import sysconfig; print(sysconfig.get_path('purelib'))"
    target = Path(succeed([python, "-c", site], folder, "no site-packages").strip())
    for file in {file for name in declared_distributions() for file in top_level_files(name)}:
        (target / file.name).symlink_to(file)
    return python


def declared_distributions() -> set[str]:
    """Returns the names of the package's requirements, and of all that they require."""
    found: dict[str, str] = {}
    waiting = [(line, "") for line in CONFIG["options"]["install_requires"].splitlines()]
    while waiting:
        line, extra = waiting.pop()
        if not line or line.startswith("#"):
            continue
        requirement = Requirement(line)
        if requirement.marker and not requirement.marker.evaluate({"extra": extra}):
            continue
        if line not in found:
            found[line] = requirement.name
            required = metadata.requires(requirement.name) or []
            waiting += itertools.product(required, requirement.extras or [""])
    return set(found.values())


def top_level_files(name: str) -> set[Path]:
    """Returns the files and folders of a distribution in its site-packages."""
    distribution = metadata.distribution(name)
    names = {file.parts[0] for file in distribution.files or () if file.parts[0] != ".."}
    return {Path(str(distribution.locate_file(name))) for name in names - {"__pycache__"}}


def test_wheel_contains_package_data_and_weights_only(built: Built) -> None:
    expected = files_below(ROOT / "keras_pendulum", "keras_pendulum") | {
        f"keras_pendulum/shipped_weights/{path.name}" for path in ROOT.glob("weights/*")
    }
    with zipfile.ZipFile(built.wheel) as archive:
        found = {name for name in archive.namelist() if ".dist-info/" not in name}
    assert found == expected
    assert found >= {
        "keras_pendulum/py.typed",
        "keras_pendulum/optimum/data/gravity_1.npz",
        "keras_pendulum/optimum/data/gravity_1_discount_0.9.npz",
        "keras_pendulum/optimum/data/gravity_10.npz",
        "keras_pendulum/optimum/data/gravity_10_discount_0.985.npz",
        "keras_pendulum/optimum/data/gravity_1_steps_100.npz",
        "keras_pendulum/optimum/data/gravity_10_steps_40.npz",
        "keras_pendulum/optimum/data/gravity_1_steps_100_discount_0.9.npz",
        "keras_pendulum/shipped_weights/reference.h5",
    }


def test_sdist_contains_sources_tests_and_weights(built: Built) -> None:
    expected = set(FILES).union(*(files_below(ROOT / name, name) for name in FOLDERS))
    expected = {name for name in expected if not name.startswith("docs/_build/")}
    with tarfile.open(built.sdist) as archive:
        found = {name.partition("/")[2] for name in archive.getnames()}
    assert expected - found == set()


def test_declared_dependencies_are_the_imported_ones() -> None:
    # matplotlib depends on Pillow, gymnasium[classic-control] on Pygame.
    distribution = {"PIL": "matplotlib", "pygame": "gymnasium"}
    imported = {
        module.partition(".")[0]
        for path in ROOT.glob("keras_pendulum/**/*.py")
        for module in imported_modules(path)
    }
    # IPython is imported only in a notebook, and torch only for a module of the user. The users of
    # an extra check for it.
    imported -= {"keras_pendulum", "IPython", "torch", *sys.stdlib_module_names}
    imported -= {"argcomplete", "tensorboard", "scipy", "distributed", "dask"}
    declared = set(re.findall(r"^[\w-]+", CONFIG["options"]["install_requires"], re.MULTILINE))
    declared.remove("tensorflow-cpu")  # the same module as `tensorflow`
    assert {distribution.get(module, module) for module in imported} == declared


def test_wheel_in_a_new_environment_evaluates_the_shipped_weights(
    built: Built, new_python: Path, tmp_path: Path
) -> None:
    pip_install(new_python, tmp_path, "--force-reinstall", built.wheel)
    weights = evaluate_reference(new_python, tmp_path)
    assert weights.match("keras_pendulum/shipped_weights/reference.h5")
    assert new_python.parents[1] in weights.parents
    script = new_python.with_name("keras-pendulum")
    shown = succeed([script], tmp_path, "no list")
    assert shown.startswith("usage: keras-pendulum ")
    for path in ROOT.glob("weights/*.h5"):
        assert re.search(rf"^  {path.stem} .* -?\d+\.\d\d$", shown, re.MULTILINE)
    printed = succeed([script, "evaluate", "--help"], tmp_path, "no help")
    assert printed.startswith("usage: keras-pendulum evaluate ")


def test_editable_install_evaluates_the_weights_of_the_checkout(
    built: Built, new_python: Path, tmp_path: Path
) -> None:
    pip_install(new_python, tmp_path, "--force-reinstall", built.editable)
    weights = evaluate_reference(new_python, tmp_path)
    assert weights == built.checkout / "weights" / "reference.h5"


def test_install_from_the_sdist_has_the_files_of_the_wheel(built: Built, tmp_path: Path) -> None:
    pip_install(
        sys.executable,
        tmp_path,
        "--no-build-isolation",
        "--target",
        tmp_path / "target",
        built.sdist,
    )
    with zipfile.ZipFile(built.wheel) as archive:
        expected = {name for name in archive.namelist() if ".dist-info/" not in name}
    package = tmp_path / "target" / "keras_pendulum"
    assert files_below(package, "keras_pendulum") == expected


def test_checkout_has_its_own_weights() -> None:
    assert kp.find_weights("reference") == ROOT / "weights" / "reference.h5"


def evaluate_reference(python: str | Path, folder: Path) -> Path:
    """Returns the weights file that the command `evaluate` finds; checks its score."""
    words = [python, "-m", "keras_pendulum.evaluate", "reference", "--episodes", "3", "--json"]
    score = json.loads(succeed(words, folder, "no evaluation"))
    expected = kp.evaluate_policy("reference", 3).mean_return
    assert score["mean_return"] == pytest.approx(expected, rel=1e-6, abs=0.01)
    return Path(score["weights"])


def pip_install(python: str | Path, folder: Path, *words: str | Path) -> None:
    # Most of the byte code would never be used.
    options = ["--quiet", "--no-compile", "--no-deps", "--no-index", *words]
    pip = [sys.executable, "-m", "pip", "--python", python, "install"]
    succeed([*pip, *options], folder, "pip could not install")


def succeed(words: Sequence[str | Path], folder: Path, complaint: str) -> str:
    """Returns the output of a command, run in a folder without any variables of Python."""
    clean = {
        name: value
        for name, value in os.environ.items()
        if not name.startswith(("PYTHON", "KERAS_", "TF_"))
    }
    done = subprocess.run(words, cwd=folder, env=clean, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        command = " ".join(map(str, words))
        pytest.fail(f"{complaint}: {command}\n{done.stdout}{done.stderr}", pytrace=False)
    return done.stdout


def files_below(folder: Path, name: str) -> set[str]:
    """Returns the paths of all files in a folder, with `name` in place of the folder."""
    return {
        f"{name}/{path.relative_to(folder).as_posix()}"
        for path in folder.rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }


def imported_modules(path: Path) -> set[str]:
    modules = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            modules |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            modules.add(node.module)
    return modules
