"""A study reads small regular files only, and follows no link out of its folder."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from test_results_folder import reply, result_files

from keras_pendulum.errors import UserError
from keras_pendulum.study.arms import own_arms
from keras_pendulum.study.results_folder import ResultsFolder

if sys.platform == "win32":
    pytest.skip("needs links, pipes and moved folders", allow_module_level=True)

FILES = ("study.json", "seconds.csv", "results/reference/reference-seed0.json")


def sparse(path: Path) -> None:
    with open(path, "wb") as file:
        file.truncate(3 * 2**30)


KINDS: dict[str, tuple[Callable[[Path], object], str]] = {
    "a pipe": (os.mkfifo, "is a link, a folder or a device"),
    "a folder": (Path.mkdir, "is a link, a folder or a device"),
    "a device": (lambda path: path.symlink_to("/dev/zero"), "is a link, a folder or a device"),
    "a link": (
        lambda path: path.symlink_to(path.parent / "other"),
        "is a link, a folder or a device",
    ),
    "3 GB": (sparse, "is larger than 4 MiB"),
    "deep JSON": (lambda path: path.write_bytes(b"[" * 10**6), "is damaged|holds another study"),
    "moderately deep JSON": (
        lambda path: path.write_bytes(
            b'{"versions": {}, "arms": [{"config": ' + b"[" * 900 + b"]" * 900 + b"}]}"
        ),
        "is damaged|holds another study",
    ),
}


def make_folder(path: Path) -> ResultsFolder:
    folder = ResultsFolder(path, own_arms(["reference"], []), 1)
    with folder.create_and_lock():
        (job,) = folder.jobs()
        folder.save(job, reply(job))
    return folder


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", FILES)
def test_strange_file_of_a_study_is_refused_or_made_again(
    name: str, kind: str, tmp_path: Path
) -> None:
    folder = make_folder(tmp_path / "study")
    (job,) = folder.jobs()
    file = folder.path / name
    file.unlink()
    make, message = KINDS[kind]
    make(file)
    if "damaged" in message and name != "study.json":
        lines: list[str] = []
        assert folder.missing_jobs(lines.append) == ([job] if "results" in name else [])
        assert "damaged" in "".join(lines) or name == "seconds.csv"
    elif kind == "3 GB" and name == "seconds.csv":  # its content is not read
        folder.require_usable()
    else:
        with (
            pytest.raises(UserError, match=f"study.* ({message})"),
            folder.create_and_lock(),
        ):
            folder.missing_jobs()


@pytest.mark.parametrize("name", ["results", "results/reference"])
def test_link_in_place_of_a_folder_of_results_is_not_followed(name: str, tmp_path: Path) -> None:
    folder = make_folder(tmp_path / "study")
    (job,) = folder.jobs()
    message = "is a link, a file or a device; expected a folder"
    with folder.create_and_lock():
        moved = (folder.path / name).rename(tmp_path / "other")
        (folder.path / name).symlink_to(moved)
        before = {file: file.read_bytes() for file in moved.rglob("*.json")}
        with pytest.raises(UserError, match=message):
            folder.save(job, reply(job))
    with pytest.raises(UserError, match=message):
        folder.require_usable()
    assert {file: file.read_bytes() for file in moved.rglob("*.json")} == before


def test_no_result_is_written_into_another_folder_at_the_same_path(tmp_path: Path) -> None:
    target, link = tmp_path / "study", tmp_path / "link"
    target.mkdir()
    link.symlink_to(target)
    folder = ResultsFolder(link, own_arms(["reference"], []), 2)
    with folder.create_and_lock():
        first, second = folder.jobs()
        link.unlink()
        link.symlink_to(tmp_path)
        folder.save(first, reply(first))
        assert len(result_files(target)) == 1
        target.rename(tmp_path / "moved")
        shutil.copytree(tmp_path / "moved", target)
        with pytest.raises(UserError, match=r"study, or the file .lock in it, was moved"):
            folder.save(second, reply(second))
    assert len(result_files(target)) == 1
