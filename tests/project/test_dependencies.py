"""setup.cfg: TensorFlow's wheels for each system and Python, as the package index has them.

The tests of the index ask pip for all files of a project. They are skipped where the index cannot
be reached.
"""

from __future__ import annotations

import configparser
import re
import subprocess
import sys
from functools import cache

import pytest
from conftest import ROOT
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet
from packaging.utils import parse_wheel_filename
from packaging.version import Version

CONFIG = configparser.ConfigParser()
CONFIG.read(ROOT / "setup.cfg", encoding="utf-8")
PYTHONS = ("3.11", "3.12", "3.13")


# Of each kind of machine: its values of the markers `sys_platform` and `platform_machine`, and the
# platforms of the wheels that it can use. A Linux of 2022 has glibc 2.35.
SYSTEMS = {
    "Linux x86-64": ("linux", "x86_64", r"manylinux_2_([12]\d|3[0-5])_x86_64"),
    "Linux aarch64": ("linux", "aarch64", r"manylinux_2_([12]\d|3[0-5])_aarch64"),
    "macOS arm64": ("darwin", "arm64", r"macosx_1[1-4]_0_(arm64|universal2)"),
    "Windows x86-64": ("win32", "AMD64", "win_amd64"),
}
WITHOUT_WHEELS = {
    "Intel Mac": ("darwin", "x86_64", r"macosx_1[0-4]_\d+_(x86_64|universal2)"),
    "Windows on Arm": ("win32", "ARM64", "win_arm64"),
}
ALL_SYSTEMS = SYSTEMS | WITHOUT_WHEELS


def tensorflow_for(system: str, python: str) -> Requirement:
    """Returns the one requirement of TensorFlow that holds on a system."""
    sys_platform, platform_machine, _ = ALL_SYSTEMS[system]
    environment = {
        "sys_platform": sys_platform,
        "platform_machine": platform_machine,
        "python_version": python,
    }
    (requirement,) = [
        requirement
        for line in CONFIG["options"]["install_requires"].strip().splitlines()
        if not line.startswith("#")
        for requirement in [Requirement(line)]
        if requirement.name.startswith("tensorflow")
        and (requirement.marker is None or requirement.marker.evaluate(environment))
    ]
    return requirement


@cache
def wheels(project: str) -> tuple[str, ...]:
    """Returns the names of all wheels of a project in pip's index, or skips the test."""
    done = subprocess.run(
        [sys.executable, "-m", "pip", "index", "versions", project, "-vv", "--retries", "0"],
        capture_output=True,
        text=True,
        check=False,
    )
    printed = (done.stdout + done.stderr).splitlines()
    if "Fetched page http" not in done.stdout:
        reasons = [line.strip() for line in printed if "Could not fetch URL" in line]
        pytest.skip(f"the package index cannot be reached: {(reasons or printed)[-1]}")
    # A line for each file, also for those that this machine could not use.
    links = [re.search(r"link.* https?://\S+/([^/\s]+\.whl)", line) for line in printed]
    return tuple({link[1] for link in links if link})


def versions(project: str, system: str, python: str) -> list[Version]:
    """Returns the versions with a wheel for a system and a Python."""
    interpreter = f"cp{python.replace('.', '')}"
    usable = re.compile(rf"-{interpreter}-{interpreter}-(.+\.)?{ALL_SYSTEMS[system][2]}[.]")
    return [parse_wheel_filename(name)[1] for name in wheels(project) if usable.search(name)]


def test_declared_pythons_are_those_of_the_classifiers() -> None:
    declared = SpecifierSet(CONFIG["options"]["python_requires"])
    assert [f"3.{i}" for i in range(20) if f"3.{i}" in declared] == list(PYTHONS)
    prefix = "Programming Language :: Python :: 3."
    classifiers = CONFIG["metadata"]["classifiers"].splitlines()
    assert [line for line in classifiers if line.startswith(prefix)] == [
        prefix + python.partition(".")[2] for python in PYTHONS
    ]


def test_each_system_gets_one_tensorflow() -> None:
    names = [tensorflow_for(system, "3.13").name for system in SYSTEMS]
    assert names == ["tensorflow-cpu", "tensorflow", "tensorflow", "tensorflow-cpu"]


@pytest.mark.slow
@pytest.mark.parametrize("python", PYTHONS)
@pytest.mark.parametrize("system", SYSTEMS)
def test_index_has_a_wheel_of_tensorflow(system: str, python: str) -> None:
    requirement = tensorflow_for(system, python)
    found = versions(requirement.name, system, python)
    assert list(requirement.specifier.filter(found)), found


@pytest.mark.slow
@pytest.mark.parametrize(
    ("system", "python"),
    [*((system, "3.14") for system in SYSTEMS), *((system, "3.13") for system in WITHOUT_WHEELS)],
)
def test_index_has_no_wheel_where_the_readme_says_so(system: str, python: str) -> None:
    for project in {"tensorflow", tensorflow_for(system, python).name}:
        assert not list(SpecifierSet("==2.21.*").filter(versions(project, system, python)))
