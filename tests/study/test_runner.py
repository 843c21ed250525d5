"""The loop that hands out jobs, with a Dask worker in a thread of this process."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from pathlib import Path

import pytest
from conftest import wait_for
from distributed import Client, LocalCluster
from test_results_folder import make_job, reply

from keras_pendulum.errors import UserError
from keras_pendulum.study import __main__ as study_command
from keras_pendulum.study import dask_workers
from keras_pendulum.study import job as job_module
from keras_pendulum.study.job import Job, Reply
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

    others = len(client.futures)  # of the tests before
    runs = run_all(client, reply, jobs())
    next(runs)
    assert len(handed_out) == 2
    wait_for(lambda: len(client.futures) <= others + 1)  # the finished one is released
    assert len(list(runs)) == 49


Study = Callable[..., tuple[int, str, str]]


@pytest.fixture
def study(
    client: Client,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> Study:
    """Runs the command `study` with the worker of this process; returns its status and output."""
    monkeypatch.setattr(dask_workers, "local_workers", lambda count: nullcontext(client))

    def run(*words: str, work: Callable[[Job], Reply] = reply) -> tuple[int, str, str]:
        monkeypatch.setattr(job_module, "train_and_score", work)
        status = study_command.main([*words, "--out", str(tmp_path / "study")])
        printed = capsys.readouterr()
        return status, printed.out, printed.err

    return run


def test_failed_runs_are_reported_and_the_next_study_retries_them(study: Study) -> None:
    def diverge(job: Job) -> Reply:
        if (job.arm, job.config.seed) == ("starved", 0):
            raise UserError("the loss is nan")
        return reply(job)

    words = ["--arm", "small: reference", "--arm", "starved: original", "--seeds", "2"]
    status, out, err = study(*words, work=diverge)
    assert (status, err) == (
        1,
        "starved, seed 0: failed, the loss is nan\n"
        "error: 1 of 4 runs failed (starved, seed 0: the loss is nan); run the same command again "
        "to retry them\n",
    )
    assert re.findall(r"^(.*): regret 16\.27, 4\.0 s, (\d/\d)", out, re.M) == [
        ("small, seed 0", "1/4"),
        ("small, seed 1", "2/4"),
        ("starved, seed 1", "3/4"),
    ]
    status, out, err = study(*words)
    assert (status, err) == (0, "")
    assert out.startswith("3 of 4 runs are already finished\nstarved, seed 0: regret 16.27, ")
    assert ", 4/4, 0:00 left\n" in out


def test_study_prints_the_reasons_of_at_most_5_failures(study: Study) -> None:
    def fail(job: Job) -> Reply:
        raise UserError("no memory")

    status, _, err = study("--presets", "reference", "--seeds", "6", work=fail)
    assert status == 1
    reasons = "; ".join(f"reference, seed {seed}: no memory" for seed in range(5))
    last = err.splitlines()[-1]
    assert last.startswith(f"error: 6 of 6 runs failed ({reasons}; and 1 more); run")


def test_study_whose_results_cannot_be_written_ends_before_its_first_run(
    study: Study, tmp_path: Path
) -> None:
    words = ["--presets", "reference", "--seeds", "1"]
    assert study(*words)[0] == 0
    results = tmp_path / "study" / "results"
    shutil.rmtree(results)
    results.touch()
    runs: list[Job] = []
    status, out, err = study(*words, work=runs.append)
    assert (status, out, runs) == (2, "", [])
    assert re.fullmatch(r"error: .*study.*: .*\n", err)


def test_lost_manifest_is_written_again_and_a_changed_result_is_made_again(
    study: Study, tmp_path: Path
) -> None:
    words = ["--presets", "reference", "--seeds", "2"]
    assert study(*words)[0] == 0
    manifest = tmp_path / "study" / "study.json"
    before = manifest.read_bytes()
    manifest.unlink()
    status, out, _ = study(*words)
    assert status == 0
    assert out.startswith("2 of 2 runs are already finished\n\n")
    assert manifest.read_bytes() == before

    result = tmp_path / "study" / "results" / "reference" / "reference-seed1.json"
    before = result.read_bytes()
    content = json.loads(before)["result"]
    for changed in (job_module._with_checksum({**content, "returns": []}), before[:100]):
        result.write_bytes(changed)
        status, out, err = study(*words)
        assert status == 0
        assert err == f"{result} is damaged or was changed: its run is made again\n"
        assert out.startswith("1 of 2 runs are already finished\nreference, seed 1: ")
        assert result.read_bytes() == before
