"""The folder of a study accepts only valid results of its own jobs."""

from __future__ import annotations

import csv
import shutil
from pathlib import Path

import pytest

from keras_pendulum.errors import UserError
from keras_pendulum.study.arms import own_arms
from keras_pendulum.study.job import Job, Reply, RunResult, encode
from keras_pendulum.study.results_folder import ResultsFolder


def reply(job: Job) -> Reply:
    """Returns a reply without training."""
    return Reply(encode(job, RunResult(0.0, [-1.5], [-0.1], [-1.5])), 1.0, 2.0, 4.0, "host:7")


def result_files(folder: Path) -> list[Path]:
    return sorted((folder / "results").glob("*/*.json"))


def test_damaged_reply_is_refused_and_the_cost_of_a_valid_one_is_logged(tmp_path: Path) -> None:
    folder = ResultsFolder(tmp_path / "study", own_arms(["reference"], []), 2)
    with folder.create_and_lock():
        first, second = folder.jobs()
        truncated, of_another_job = reply(first).result[:-9], reply(second).result
        for data in (truncated, of_another_job):
            with pytest.raises(
                UserError, match="host:7 sent a damaged result of reference, seed 0"
            ):
                folder.save(first, reply(first)._replace(result=data))
        assert result_files(folder.path) == []
        folder.save(second, reply(second))
        assert folder.missing_jobs() == [first]
    with open(folder.path / "seconds.csv", newline="") as file:
        (row,) = csv.DictReader(file)
    assert row == {
        "arm": "reference",
        "seed": "1",
        "worker": "host:7",
        "training": "1.000",
        "evaluation": "2.000",
        "total": "4.000",
    }


def test_results_of_other_versions_are_missing(tmp_path: Path) -> None:
    folder = ResultsFolder(tmp_path / "study", own_arms(["reference"], []), 2)
    with folder.create_and_lock():
        for job in folder.jobs():
            folder.save(job, reply(job))
    assert folder.missing_jobs() == []
    folder.versions = {**folder.versions, "keras": "2.0"}
    assert len(folder.missing_jobs()) == 2


def test_folder_in_use_is_refused(tmp_path: Path) -> None:
    first, second = (
        ResultsFolder(tmp_path / "study", own_arms(["reference"], []), 2) for _ in range(2)
    )
    with (
        first.create_and_lock(),
        pytest.raises(UserError, match="study"),
        second.create_and_lock(),
    ):
        pass


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
        with pytest.raises(UserError, match="study was moved, removed or replaced"):
            folder.save(second, reply(second))
    assert len(result_files(target)) == 1
