"""The loop that hands out jobs, with a Dask worker in a thread of this process."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from distributed import Client, LocalCluster

from keras_pendulum.config.presets import preset
from keras_pendulum.errors import UserError
from keras_pendulum.study import __main__ as study_command
from keras_pendulum.study import dask_workers
from keras_pendulum.study import job as job_module
from keras_pendulum.study.job import Job, Reply, RunResult, curve_points, encode
from keras_pendulum.study.runner import run_all


@pytest.fixture(scope="module")
def client() -> Iterator[Client]:
    with (
        LocalCluster(
            processes=False, n_workers=1, threads_per_worker=1, dashboard_address="127.0.0.1:0"
        ) as cluster,
        Client(cluster, set_as_default=False) as client,
    ):
        yield client


def make_job(seed: int) -> Job:
    return Job("arm", "arm", preset("reference", seed=seed), {})


def reply(job: Job) -> Reply:
    """Returns a reply without training."""
    points = len(curve_points([0.0] * job.config.episodes))
    result = RunResult(0.0, [-1.5] * 100, [-0.1] * points, [-1.5] * points, [1.5] * 10)
    return Reply(encode(job, result), 1.0, 2.0, 4.0, "host:7")


def flaky_work(
    attempts: Path, error: Exception, failures: dict[int, int]
) -> Callable[[Job], Reply]:
    """Returns work that fails in the first attempts of some seeds, and counts all attempts."""

    def work(job: Job) -> Reply:
        seed = job.config.seed
        with open(attempts, "a", encoding="utf-8") as file:
            file.write(f"{seed}\n")
        if attempts.read_text(encoding="utf-8").split().count(str(seed)) <= failures.get(seed, 0):
            raise error
        return reply(job)

    return work


def test_failing_job_is_repeated_twice_and_the_others_continue(
    client: Client, tmp_path: Path
) -> None:
    work = flaky_work(tmp_path / "attempts", OSError("no\ndisk"), {1: 2, 2: 99})
    lines: list[str] = []
    finished = {
        each.job.config.seed: each
        for each in run_all(client, work, map(make_job, range(5)), lines.append)
    }
    attempts = sorted((tmp_path / "attempts").read_text().split())
    assert attempts == ["0", "1", "1", "1", "2", "2", "2", "3", "4"]
    assert [seed for seed, each in finished.items() if each.reply is None] == [2]
    assert finished[2].problem == "OSError: no disk"
    assert finished[1].reply == reply(make_job(1))
    assert sorted(lines) == [
        f"arm, seed {seed}: repeated after OSError: no disk" for seed in (1, 1, 2, 2)
    ]


def test_user_error_is_not_repeated(client: Client, tmp_path: Path) -> None:
    work = flaky_work(tmp_path / "attempts", UserError("the loss is nan"), {0: 99})
    (finished,) = run_all(client, work, [make_job(0)])
    assert (finished.reply, finished.problem) == (None, "the loss is nan")
    assert (tmp_path / "attempts").read_text() == "0\n"


class UnpicklableError(Exception):
    def __reduce__(self) -> str:
        raise TypeError("no pickle")


def test_exception_that_does_not_pickle_is_reported(client: Client) -> None:
    def work(job: Job) -> Reply:
        raise UnpicklableError("oops")

    (finished,) = run_all(client, work, [make_job(0)])
    assert "UnpicklableError('oops')" in finished.problem


def test_each_worker_has_one_job_at_a_time(client: Client) -> None:
    handed_out = []

    def jobs() -> Iterator[Job]:
        for seed in range(50):
            handed_out.append(seed)
            yield make_job(seed)

    runs = run_all(client, reply, jobs())
    next(runs)
    assert len(handed_out) == 2
    assert len(list(runs)) == 49


def use_workers_of(client: Client, monkeypatch: pytest.MonkeyPatch) -> None:
    """Makes the command `study` use the worker of this process."""

    @contextmanager
    def local_workers(count: int) -> Iterator[Client]:
        yield client

    monkeypatch.setattr(dask_workers, "local_workers", local_workers)


def test_failed_runs_are_reported_and_the_next_study_retries_them(
    client: Client,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def diverge(job: Job) -> Reply:
        if (job.arm, job.config.seed) == ("starved", 0):
            raise UserError("the loss is nan")
        return reply(job)

    use_workers_of(client, monkeypatch)
    monkeypatch.setattr(job_module, "train_and_score", diverge)
    words = ["--arm", "small: reference", "--arm", "starved: original", "--seeds", "2"]
    words += ["--out", str(tmp_path / "study")]
    assert study_command.main(words) == 1
    printed = capsys.readouterr()
    assert printed.err == (
        "starved, seed 0: failed, the loss is nan\n"
        "error: 1 of 4 runs failed (starved, seed 0: the loss is nan); run the same command again "
        "to retry them\n"
    )
    assert re.findall(r"^(.*): regret 1\.50, 4\.0 s, (\d/\d)", printed.out, re.M) == [
        ("small, seed 0", "1/4"),
        ("small, seed 1", "2/4"),
        ("starved, seed 1", "3/4"),
    ]

    monkeypatch.setattr(job_module, "train_and_score", reply)
    assert study_command.main(words) == 0
    printed = capsys.readouterr()
    assert printed.err == ""
    assert printed.out.startswith(
        "3 of 4 runs are already finished\nstarved, seed 0: regret 1.50, "
    )
    assert ", 4/4, 0:00 left\n" in printed.out


@pytest.mark.parametrize("obstacle", ["the folder", "its results"])
def test_study_whose_folder_cannot_be_made_ends_before_its_first_run(
    obstacle: str,
    client: Client,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    use_workers_of(client, monkeypatch)
    monkeypatch.setattr(job_module, "train_and_score", reply)
    (tmp_path / "file").touch()
    folder = tmp_path / ("file/study" if obstacle == "the folder" else "study")
    words = ["--presets", "reference", "--seeds", "1", "--out", str(folder)]
    if obstacle == "its results":
        assert study_command.main(words) == 0
        shutil.rmtree(folder / "results")
        (folder / "results").touch()
        capsys.readouterr()
    runs: list[Job] = []
    monkeypatch.setattr(job_module, "train_and_score", runs.append)
    assert study_command.main(words) == 2
    printed = capsys.readouterr()
    assert re.fullmatch(r"error: cannot .*study.*: .*\n", printed.err)
    assert (printed.out, runs) == ("", [])


def test_lost_manifest_is_written_again_and_an_edited_result_is_made_again(
    client: Client,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    use_workers_of(client, monkeypatch)
    monkeypatch.setattr(job_module, "train_and_score", reply)
    folder = tmp_path / "study"
    words = ["--presets", "reference", "--seeds", "2", "--out", str(folder)]
    assert study_command.main(words) == 0
    manifest = (folder / "study.json").read_bytes()
    (folder / "study.json").unlink()
    capsys.readouterr()
    assert study_command.main(words) == 0
    assert capsys.readouterr().out.startswith("2 of 2 runs are already finished\n\n")
    assert (folder / "study.json").read_bytes() == manifest

    edited = folder / "results" / "reference" / "reference-seed1.json"
    before = edited.read_bytes()
    content = json.loads(before)["result"]
    edited.write_bytes(job_module._with_checksum({**content, "returns": []}))
    assert study_command.main(words) == 0
    printed = capsys.readouterr()
    assert printed.err == f"{edited} is damaged or was changed: its run is made again\n"
    assert printed.out.startswith("1 of 2 runs are already finished\nreference, seed 1: ")
    assert edited.read_bytes() == before
