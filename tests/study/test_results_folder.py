"""The folder of a study accepts only valid results of its own jobs."""

from __future__ import annotations

import csv
import errno
import json
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from keras_pendulum.config.presets import preset
from keras_pendulum.errors import UserError
from keras_pendulum.storage import atomic_write
from keras_pendulum.study import results_folder
from keras_pendulum.study.arms import own_arms
from keras_pendulum.study.job import (
    Job,
    Reply,
    RunResult,
    curve_points,
    encode,
    evaluate_every,
)
from keras_pendulum.study.results_folder import ResultsFolder


def make_job(seed: int) -> Job:
    return Job("arm", "arm", preset("reference", seed=seed), {})


def reply(job: Job) -> Reply:
    """Returns a reply without training."""
    low, high = job.config.task.reward_range
    points = [low or high] * len(curve_points([0.0] * job.config.episodes))
    evaluations = job.config.episodes // evaluate_every(job.config)
    result = RunResult(0.0, [low or high] * 100, points, points, [0.0] * evaluations)
    return Reply(encode(job, result), 1.0, 2.0, 4.0, "host:7")


def fill(folder: ResultsFolder) -> None:
    """Makes the folder of a study with all results."""
    with folder.create_and_lock():
        for job in folder.jobs():
            folder.save(job, reply(job))


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
    with open(folder.path / "seconds.csv", encoding="utf-8", newline="") as file:
        (row,) = csv.DictReader(file)
    assert row == {
        "arm": "reference",
        "seed": "1",
        "worker": "host:7",
        "training": "1.000",
        "evaluation": "2.000",
        "total": "4.000",
    }


def test_log_that_windows_has_open_gets_its_line_when_it_is_closed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    refusals = [PermissionError(errno.EACCES, "Permission denied")] * 3

    def open_closed(path: Path, mode: str, **options: Any) -> Any:
        if refusals:
            raise refusals.pop()
        return open(path, mode, **options)

    monkeypatch.setattr(atomic_write, "sys", SimpleNamespace(platform="win32"))
    monkeypatch.setattr(atomic_write, "time", SimpleNamespace(sleep=lambda seconds: None))
    monkeypatch.setattr(results_folder, "open", open_closed, raising=False)
    folder = ResultsFolder(tmp_path / "study", own_arms(["reference"], []), 1)
    fill(folder)
    assert refusals == []
    lines = (folder.path / "seconds.csv").read_bytes().splitlines()
    assert lines[1:] == [b"reference,0,host:7,1.000,2.000,4.000"]


def test_results_of_other_versions_are_missing(tmp_path: Path) -> None:
    folder = ResultsFolder(tmp_path / "study", own_arms(["reference"], []), 2)
    fill(folder)
    assert folder.missing_jobs() == []
    folder.versions = {**folder.versions, "keras": "2.0"}
    assert len(folder.missing_jobs()) == 2


BOTH = ["reference", "cartpole"]


def fill_without_manifest(path: Path) -> None:
    """Makes a folder with all results of a study, whose `study.json` is lost."""
    fill(ResultsFolder(path, own_arms(BOTH, []), 2))
    (path / "study.json").unlink()


def test_folder_of_an_older_version_with_settings_that_have_no_effect_is_used(
    tmp_path: Path,
) -> None:
    folder = ResultsFolder(tmp_path, own_arms(["reference"], []), 1)
    with folder.create_and_lock():
        manifest = json.loads((tmp_path / "study.json").read_bytes())
    cases: list[tuple[dict[str, Any], Any]] = [
        ({"seed": 0, "save_every": 7, "target_period": 5}, nullcontext()),
        ({"discount": 0.5}, pytest.raises(UserError, match="holds another study")),
        ({"discount": 5}, pytest.raises(UserError, match="holds another study")),
    ]
    for settings, outcome in cases:
        old = {**manifest["arms"][0], "config": {**manifest["arms"][0]["config"], **settings}}
        (tmp_path / "study.json").write_text(json.dumps({**manifest, "arms": [old]}))
        with outcome:
            folder.require_usable()


@pytest.mark.parametrize("seeds", [1, 2, 3])
def test_results_without_manifest_are_used_by_the_same_study(seeds: int, tmp_path: Path) -> None:
    fill_without_manifest(tmp_path)
    folder = ResultsFolder(tmp_path, own_arms(BOTH, []), seeds)
    folder.require_usable()
    with folder.create_and_lock():
        assert len(folder.missing_jobs()) == 2 * max(0, seeds - 2)
    assert (tmp_path / "study.json").exists()


@pytest.mark.parametrize(
    ("presets", "arms", "change", "first"),
    [
        (["reference"], [], "", "cartpole/cartpole-seed0.json"),
        (["cartpole"], ["reference: reference tau=0.5"], "", "reference/reference-seed0.json"),
        (BOTH, [], "damage", "cartpole/cartpole-seed0.json"),
        (BOTH, [], "name", "reference/reference-seed01.json"),
    ],
)
def test_results_without_manifest_are_refused_by_name_in_another_study(
    presets: list[str], arms: list[str], change: str, first: str, tmp_path: Path
) -> None:
    fill_without_manifest(tmp_path)
    file = tmp_path / "results" / first
    if change == "damage":
        file.write_bytes(file.read_bytes()[:-9])
    elif change == "name":
        file.with_name("reference-seed1.json").rename(file)
    folder = ResultsFolder(tmp_path, own_arms(presets, arms), 2)
    before = {file: file.read_bytes() for file in tmp_path.rglob("*.*")}
    with pytest.raises(UserError) as caught, folder.create_and_lock():
        pass
    assert f"{first} is not a result of this study, and study.json is missing: run" in str(
        caught.value
    )
    assert {file: file.read_bytes() for file in tmp_path.rglob("*.*")} == before


def test_folder_in_use_is_refused(tmp_path: Path) -> None:
    first, second = (ResultsFolder(tmp_path, own_arms(["reference"], []), 2) for _ in range(2))
    with (
        first.create_and_lock(),
        pytest.raises(UserError, match="another run is writing"),
        second.create_and_lock(),
    ):
        pass
