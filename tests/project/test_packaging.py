"""Wheel, sdist and checkout: each has all files of the package."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest
from conftest import ROOT
from test_dependencies import CONFIG
from test_floor_plan import imports

import keras_pendulum as kp

FILES = (
    *("CHANGELOG.md", "CITATION.cff", "CONTRIBUTING.md", "LICENSE", "MANIFEST.in", "README.md"),
    *("pyproject.toml", "setup.cfg", "setup.py"),
)
FOLDERS = ("benchmarks", "docs", "examples", "keras_pendulum", "tests", "weights")


# The packages of extras and of users, without which the commands start.
OPTIONAL = {"IPython", "torch", "argcomplete", "scipy", "distributed", "dask"}


@dataclass(frozen=True)
class Built:
    sdist: Path  # unpacked
    wheel: Path  # made from the sdist, as pip does


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Built:
    """Builds sdist and wheel from a copy of the checkout, without files of earlier builds."""
    checkout = tmp_path_factory.mktemp("checkout")
    for name in FILES:
        shutil.copy(ROOT / name, checkout)
    for name in FOLDERS:
        ignored = shutil.ignore_patterns("__pycache__", "_build")
        shutil.copytree(ROOT / name, checkout / name, ignore=ignored)
    build("sdist", checkout)
    (archive,) = checkout.glob("dist/*.tar.gz")
    shutil.unpack_archive(archive, checkout / "unpacked", filter="data")
    (sdist,) = (checkout / "unpacked").iterdir()
    build("wheel", sdist)
    (wheel,) = sdist.glob("dist/*.whl")
    return Built(sdist, wheel)


def build(kind: str, folder: Path) -> None:
    code = f"from setuptools.build_meta import build_{kind}; build_{kind}('dist')"
    succeed([sys.executable, "-c", code], folder, "the build failed")


def test_wheel_contains_package_data_and_weights_only(built: Built) -> None:
    expected = files_below(ROOT / "keras_pendulum", "keras_pendulum") | {
        f"keras_pendulum/shipped_weights/{path.name}" for path in ROOT.glob("weights/*")
    }
    expected.add("keras_pendulum/exercise/my_dqn.py")  # of examples/
    with zipfile.ZipFile(built.wheel) as archive:
        found = {name for name in archive.namelist() if ".dist-info/" not in name}
    assert found == expected


def test_sdist_contains_sources_tests_and_weights(built: Built) -> None:
    expected = set(FILES).union(*(files_below(ROOT / name, name) for name in FOLDERS))
    missing = [name for name in sorted(expected) if not (built.sdist / name).is_file()]
    assert [name for name in missing if not name.startswith("docs/_build/")] == []


def test_declared_dependencies_are_the_imported_ones() -> None:
    # matplotlib depends on Pillow, gymnasium[classic-control] on Pygame.
    distribution = {"PIL": "matplotlib", "pygame": "gymnasium"}
    imported = {
        module.partition(".")[0]
        for path in ROOT.glob("keras_pendulum/**/*.py")
        for module in imports(path)
    }
    # IPython is imported only in a notebook, and torch only for a module of the user. The users of
    # an extra check for it.
    imported -= {"keras_pendulum", "tensorboard", *OPTIONAL, *sys.stdlib_module_names}
    declared = set(re.findall(r"^[\w-]+", CONFIG["options"]["install_requires"], re.MULTILINE))
    declared.remove("tensorflow-cpu")  # the same module as `tensorflow`
    assert {distribution.get(module, module) for module in imported} == declared


def test_installed_wheel_evaluates_the_shipped_weights(built: Built, tmp_path: Path) -> None:
    # Most of the byte code would never be used.
    options = ["--quiet", "--no-compile", "--no-deps", "--no-index", "--target", "installed"]
    words: list[str | Path] = [sys.executable, "-m", "pip", "install", *options, built.wheel]
    succeed(words, tmp_path, "pip could not install")
    installed = tmp_path / "installed"
    code = f"import runpy, sys; sys.modules.update(dict.fromkeys({OPTIONAL})); "
    code += "runpy.run_module('keras_pendulum', run_name='__main__', alter_sys=True)"
    words = [sys.executable, "-c", code, "evaluate", "reference", "--episodes", "3", "--json"]
    score = json.loads(succeed(words, tmp_path, "no evaluation", installed))
    expected = kp.evaluate_policy("reference", 3).mean_return
    assert score["mean_return"] == pytest.approx(expected, rel=1e-6, abs=0.01)
    weights = installed / "keras_pendulum" / "shipped_weights" / "reference.h5"
    assert Path(score["weights"]) == weights
    script = installed / "bin" / "keras-pendulum"
    shown = succeed([script], tmp_path, "no list", installed)
    assert shown.startswith("usage: keras-pendulum ")
    for path in ROOT.glob("weights/*.h5"):
        assert re.search(rf"^  {path.stem} .* -?\d+\.\d\d$", shown, re.MULTILINE)
    printed = succeed([script, "evaluate", "--help"], tmp_path, "no help", installed)
    assert printed.startswith("usage: keras-pendulum evaluate ")


def test_editable_install_is_a_path_that_a_clone_of_the_same_name_does_not_hide(
    built: Built, tmp_path: Path
) -> None:
    clone = tmp_path / "keras_pendulum"
    shutil.copytree(built.sdist, clone, ignore=shutil.ignore_patterns("build", "dist"))
    build("editable", clone)
    (wheel,) = clone.glob("dist/*.whl")
    shutil.unpack_archive(wheel, tmp_path / "site", "zip")
    code = "import site; site.addsitedir('site'); import keras_pendulum as kp; "
    code += "print(kp.__file__, kp.find_weights('original'), sep='\\n')"
    printed = succeed([sys.executable, "-S", "-c", code], tmp_path, "no import")
    expected = [clone / "keras_pendulum" / "__init__.py", clone / "weights" / "original.h5"]
    assert printed.splitlines() == list(map(str, expected))


def test_editable_install_of_the_readme_has_the_weights_of_the_checkout() -> None:
    assert kp.find_weights("reference") == ROOT / "weights" / "reference.h5"


def succeed(
    words: Sequence[str | Path], folder: Path, complaint: str, installed: Path | None = None
) -> str:
    """Returns the output of a command, run in a folder without any variables of Python.

    Its Python finds the package in the folder `installed` first.
    """
    environment = {
        name: value
        for name, value in os.environ.items()
        if not name.startswith(("PYTHON", "KERAS_", "TF_"))
    }
    if installed:
        environment["PYTHONPATH"] = str(installed)
    done = subprocess.run(
        words, cwd=folder, env=environment, capture_output=True, text=True, check=False
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
