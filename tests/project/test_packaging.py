"""Wheel, sdist, editable install and checkout: each finds all files of the package."""

from __future__ import annotations

import ast
import configparser
import json
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
import zipfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from conftest import ROOT

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
def new_python(built: Built, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Creates a virtual environment with the wheel and its dependencies."""
    folder = tmp_path_factory.mktemp("new")
    succeed([sys.executable, "-m", "venv", "environment"], folder, "no virtual environment")
    python = folder / "environment" / "bin" / "python"
    pip_install(python, folder, built.wheel)
    yield python
    shutil.rmtree(folder)  # 1.7 GB, which pytest would delete only three runs later


@pytest.fixture(scope="module")
def checkout_score() -> dict[str, Any]:
    """Returns the score of `evaluate reference` in the checkout."""
    return evaluate_reference(sys.executable, ROOT)


def test_wheel_contains_package_data_and_weights_only(built: Built) -> None:
    expected = files_below(ROOT / "keras_pendulum", "keras_pendulum") | {
        f"keras_pendulum/shipped_weights/{path.name}" for path in ROOT.glob("weights/*.h5")
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
    config = configparser.ConfigParser()
    config.read(ROOT / "setup.cfg", encoding="utf-8")
    declared = set(re.findall(r"^[\w-]+", config["options"]["install_requires"], re.MULTILINE))
    declared.remove("tensorflow-cpu")  # the same module as `tensorflow`
    assert {distribution.get(module, module) for module in imported} == declared


@pytest.mark.parametrize("kind", ["wheel", "editable"])
def test_new_environment_evaluates_the_shipped_weights(
    kind: str, built: Built, new_python: Path, checkout_score: dict[str, Any], tmp_path: Path
) -> None:
    pip_install(
        new_python, tmp_path, "--no-deps", "--no-index", "--force-reinstall", getattr(built, kind)
    )
    score = evaluate_reference(new_python, tmp_path)
    assert same_score(score, checkout_score)
    if kind == "wheel":
        assert in_package(score, new_python.parents[1])
    else:
        assert Path(score["weights"]) == built.checkout / "weights" / "reference.h5"


def test_install_from_the_sdist_evaluates_the_shipped_weights(
    built: Built, checkout_score: dict[str, Any], tmp_path: Path
) -> None:
    target, empty = tmp_path / "target", tmp_path / "empty"
    empty.mkdir()
    pip_install(
        sys.executable,
        empty,
        *("--no-deps", "--no-index", "--no-build-isolation", "--target", target, built.sdist),
    )
    score = evaluate_reference(sys.executable, empty, PYTHONPATH=str(target))
    assert same_score(score, checkout_score)
    assert in_package(score, target)


def test_checkout_evaluates_its_own_weights(checkout_score: dict[str, Any]) -> None:
    assert Path(checkout_score["weights"]) == ROOT / "weights" / "reference.h5"


def test_installed_script_lists_the_shipped_weights(built: Built, tmp_path: Path) -> None:
    target, empty = tmp_path / "target", tmp_path / "empty"
    empty.mkdir()
    pip_install(sys.executable, empty, "--no-deps", "--no-index", "--target", target, built.wheel)
    script = shutil.which("keras-pendulum", path=target / "bin")
    assert script is not None
    shown = succeed([script], empty, "no list", PYTHONPATH=str(target))
    assert shown.startswith("usage: keras-pendulum ")
    for path in ROOT.glob("weights/*.h5"):
        assert re.search(rf"^  {path.stem} .* -?\d+\.\d\d$", shown, re.MULTILINE)
    printed = succeed([script, "evaluate", "--help"], empty, "no help", PYTHONPATH=str(target))
    assert printed.startswith("usage: keras-pendulum evaluate ")


def same_score(score: dict[str, Any], other: dict[str, Any]) -> bool:
    return bool(score["mean_return"] == pytest.approx(other["mean_return"], rel=1e-6, abs=0.01))


def in_package(score: dict[str, Any], folder: Path) -> bool:
    path = Path(score["weights"])
    return path.match("keras_pendulum/shipped_weights/reference.h5") and folder in path.parents


def evaluate_reference(python: str | Path, folder: Path, **environment: str) -> dict[str, Any]:
    words = [python, "-m", "keras_pendulum.evaluate", "reference", "--episodes", "3", "--json"]
    with tempfile.TemporaryDirectory() as cache:  # an empty cache
        environment["XDG_CACHE_HOME"] = cache
        score: dict[str, Any] = json.loads(succeed(words, folder, "no evaluation", **environment))
    return score


def pip_install(python: str | Path, folder: Path, *words: str | Path) -> None:
    # Most of the byte code would never be used.
    succeed(
        [python, "-m", "pip", "install", "--quiet", "--no-compile", *words],
        folder,
        "pip could not install; dependencies need a package registry that pip can reach",
    )


def succeed(words: Sequence[str | Path], folder: Path, complaint: str, **environment: str) -> str:
    """Returns the output of a command, run in a folder without any variables of Python."""
    clean = {
        name: value
        for name, value in os.environ.items()
        if not name.startswith(("PYTHON", "KERAS_", "TF_"))
    }
    done = subprocess.run(
        words, cwd=folder, env=clean | environment, capture_output=True, text=True, check=False
    )
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
