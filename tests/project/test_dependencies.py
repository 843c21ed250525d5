"""setup.cfg: TensorFlow's wheels for each system and Python, as the package index has them.

The tests of the index ask pip for all files of a project. They are skipped where the index cannot
be reached.
"""

from __future__ import annotations

import configparser
import re
import subprocess
import sys
from dataclasses import dataclass
from functools import cache

import pytest
from conftest import ROOT
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet
from packaging.tags import mac_platforms, parse_tag
from packaging.utils import parse_wheel_filename
from packaging.version import Version

CONFIG = configparser.ConfigParser()
CONFIG.read(ROOT / "setup.cfg", encoding="utf-8")
PYTHONS = ("3.11", "3.12", "3.13")


@dataclass(frozen=True)
class System:
    """A kind of machine: its values of the markers, and pip's names for it."""

    sys_platform: str
    platform_machine: str
    tags: tuple[str, ...]


def linux(machine: str) -> System:
    """Returns a Linux of 2022: its C library is glibc 2.35."""
    return System("linux", machine, tuple(f"manylinux_2_{i}_{machine}" for i in range(17, 36)))


SYSTEMS = {
    "Linux x86-64": linux("x86_64"),
    "Linux aarch64": linux("aarch64"),
    "macOS arm64": System("darwin", "arm64", tuple(mac_platforms((14, 0), "arm64"))),
    "Windows x86-64": System("win32", "AMD64", ("win_amd64",)),
}
WITHOUT_WHEELS = {
    "Intel Mac": System("darwin", "x86_64", tuple(mac_platforms((14, 0), "x86_64"))),
    "Windows on Arm": System("win32", "ARM64", ("win_arm64",)),
}


def tensorflow_for(system: System, python: str) -> Requirement:
    """Returns the one requirement of TensorFlow that holds on a system."""
    environment = {
        "sys_platform": system.sys_platform,
        "platform_machine": system.platform_machine,
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


def versions(project: str, system: System, python: str) -> list[Version]:
    """Returns the versions with a wheel for a system and a Python."""
    interpreter = f"cp{python.replace('.', '')}"
    tags = {
        tag
        for platform in system.tags
        for tag in parse_tag(f"{interpreter}-{interpreter}-{platform}")
    }
    found = [parse_wheel_filename(name) for name in wheels(project)]
    return [version for _, version, _, supported in found if supported & tags]


def test_declared_pythons_are_those_of_the_classifiers() -> None:
    declared = SpecifierSet(CONFIG["options"]["python_requires"])
    assert [f"3.{i}" for i in range(20) if f"3.{i}" in declared] == list(PYTHONS)
    prefix = "Programming Language :: Python :: 3."
    classifiers = CONFIG["metadata"]["classifiers"].splitlines()
    assert [line for line in classifiers if line.startswith(prefix)] == [
        prefix + python.partition(".")[2] for python in PYTHONS
    ]


def test_each_system_gets_one_tensorflow() -> None:
    names = [tensorflow_for(system, "3.13").name for system in SYSTEMS.values()]
    assert names == ["tensorflow-cpu", "tensorflow", "tensorflow", "tensorflow-cpu"]


@pytest.mark.slow
@pytest.mark.parametrize("python", PYTHONS)
@pytest.mark.parametrize("system", SYSTEMS)
def test_index_has_a_wheel_of_tensorflow(system: str, python: str) -> None:
    requirement = tensorflow_for(SYSTEMS[system], python)
    found = versions(requirement.name, SYSTEMS[system], python)
    assert list(requirement.specifier.filter(found)), found


@pytest.mark.slow
@pytest.mark.parametrize(
    ("system", "python"),
    [*((system, "3.14") for system in SYSTEMS), *((system, "3.13") for system in WITHOUT_WHEELS)],
)
def test_index_has_no_wheel_where_the_readme_says_so(system: str, python: str) -> None:
    machine = {**SYSTEMS, **WITHOUT_WHEELS}[system]
    for project in {"tensorflow", tensorflow_for(machine, python).name}:
        assert not list(SpecifierSet("==2.21.*").filter(versions(project, machine, python)))
