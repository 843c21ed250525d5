"""Worker processes of this machine, and those of a Dask scheduler."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from functools import partial
from pathlib import Path
from threading import Thread

import psutil
import pytest

from keras_pendulum.config.presets import preset
from keras_pendulum.errors import UserError
from keras_pendulum.study import dask_workers
from keras_pendulum.study.dask_workers import cluster_workers, dashboard, local_workers
from keras_pendulum.study.job import Job, Reply, installed_versions
from keras_pendulum.study.runner import run_all


@pytest.fixture(autouse=True)
def restored_environment() -> Iterator[None]:
    before = dict(os.environ)
    yield
    os.environ.clear()
    os.environ.update(before)


def wait_for(condition: Callable[[], object]) -> None:
    deadline = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def make_job(seed: int) -> Job:
    return Job("arm", "arm", preset("reference", seed=seed), {})


def describe_worker(job: Job) -> Reply:
    """Returns the worker's number of OpenMP threads and its process."""
    return Reply(os.environ["OMP_NUM_THREADS"].encode(), 0, 0, 0, str(os.getpid()))


def kill_worker_of_seed_0(attempts: Path, failures: int, job: Job) -> Reply:
    if job.config.seed == 0:
        with open(attempts, "a") as file:
            file.write("x")
        if len(attempts.read_text()) <= failures:
            os.kill(os.getpid(), signal.SIGKILL)
    return describe_worker(job)


def wait_a_minute(started: Path, job: Job) -> Reply:
    started.touch()
    time.sleep(60)
    return describe_worker(job)


def test_killed_worker_is_reported_and_replaced_and_its_job_repeated(tmp_path: Path) -> None:
    work = partial(kill_worker_of_seed_0, tmp_path / "attempts", 1)
    lines: list[str] = []
    with local_workers(1) as client:
        finished = list(run_all(client, work, map(make_job, range(2)), lines.append))
    assert len([each for each in finished if each.reply]) == 2
    assert (tmp_path / "attempts").read_text() == "xx"
    (line,) = lines
    assert re.fullmatch(r"lost the worker tcp://127.0.0.1:\d+, interrupting arm, seed 0", line)


def test_job_that_kills_every_worker_fails_after_three_attempts_and_no_other_job(
    tmp_path: Path,
) -> None:
    work = partial(kill_worker_of_seed_0, tmp_path / "attempts", 99)
    lines: list[str] = []
    with local_workers(1) as client:
        finished = list(run_all(client, work, map(make_job, range(3)), lines.append))
    problems = {each.job.config.seed: each.problem for each in finished}
    assert problems == {0: "it lost its worker 3 times", 1: "", 2: ""}
    assert (tmp_path / "attempts").read_text() == "xxx"
    assert len(lines) == 3
    assert all(line.endswith(", interrupting arm, seed 0") for line in lines)


def listening_addresses() -> set[str]:
    this_process = psutil.Process()
    return {
        connection.laddr.ip
        for process in [this_process, *this_process.children(recursive=True)]
        for connection in process.net_connections("inet")
        if connection.status == psutil.CONN_LISTEN
    }


def test_local_workers_use_one_thread_and_only_this_machine_reaches_them() -> None:
    before = listening_addresses()
    with local_workers(1) as client:
        finished = list(run_all(client, describe_worker, map(make_job, range(3))))
        assert listening_addresses() - before == {"127.0.0.1"}
        assert dashboard(client) is None
    assert {each.reply.result for each in finished if each.reply} == {b"1"}
    assert len({each.reply.worker for each in finished if each.reply}) == 1


def test_end_of_local_workers_does_not_wait_for_their_jobs(tmp_path: Path) -> None:
    work = partial(wait_a_minute, tmp_path / "started")
    before = psutil.Process().children()
    with local_workers(1) as client:
        future = client.submit(work, make_job(0))
        wait_for((tmp_path / "started").exists)
        started = time.monotonic()
        del future
    assert time.monotonic() - started < 20
    remaining = [child for child in psutil.Process().children() if child not in before]
    assert not [child for child in remaining if "spawn_main" in " ".join(child.cmdline())]


@contextmanager
def running(*words: str | Path) -> Iterator[subprocess.Popen[bytes]]:
    with subprocess.Popen(
        [sys.executable, "-m", *map(str, words)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parent)},  # they unpickle its functions
    ) as process:
        try:
            yield process
        finally:
            process.kill()


@contextmanager
def running_scheduler(folder: Path) -> Iterator[tuple[subprocess.Popen[bytes], str]]:
    """Yields a scheduler's process and its address."""
    file = folder / "scheduler.json"
    words = ["distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0"]
    with running(*words, "--no-dashboard", "--scheduler-file", file) as process:
        wait_for(lambda: file.exists() and file.read_text().endswith("}"))
        yield process, json.loads(file.read_text())["address"]


def running_worker(address: str, threads: int = 1) -> AbstractContextManager[object]:
    words = ["distributed.cli.dask_worker", address, "--no-nanny", "--nthreads", str(threads)]
    return running(*words)


def refusal(address: str, versions: dict[str, str]) -> str:
    with pytest.raises(UserError) as caught, cluster_workers(address, versions):
        pass
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_unsuitable_cluster_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    versions = installed_versions()
    with running_scheduler(tmp_path) as (_, address):
        monkeypatch.setattr(dask_workers, "_FIRST_WORKER_SECONDS", 0.1)
        assert refusal(address, versions) == (
            f"the scheduler at {address} has no worker: start some with "
            f"`dask worker {address} --nthreads 1 --nworkers N`"
        )
        monkeypatch.undo()
        with running_worker(address, threads=2):
            assert "has 2 threads: start workers with --nthreads 1" in refusal(address, versions)
        with running_worker(address):
            other = {**versions, "numpy": "1.0"}
            assert "the scheduler has numpy 2" in refusal(address, other)
            # Also where only the workers differ.
            monkeypatch.setattr("distributed.Client.run_on_scheduler", lambda self, function: other)
            assert "the worker tcp://127.0.0.1:" in refusal(address, other)


def test_scheduler_that_does_not_answer_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dask_workers, "_ANSWER_SECONDS", 0.2)
    for address in ("tcp://127.0.0.1:1", "no such place"):
        assert refusal(address, {}).startswith(f"no scheduler answers at {address}: start one")


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_lost_scheduler_is_noticed_while_no_job_finishes(
    number: signal.Signals, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    work = partial(wait_a_minute, tmp_path / "started")
    lines: list[str] = []
    with running_scheduler(tmp_path) as (scheduler, address), running_worker(address):

        def stop_scheduler() -> None:
            wait_for((tmp_path / "started").exists)
            scheduler.send_signal(number)

        with cluster_workers(address, installed_versions()) as client:
            Thread(target=stop_scheduler).start()
            with pytest.raises(UserError) as caught:
                list(run_all(client, work, [make_job(0)], lines.append))
    assert str(caught.value) == (
        f"the scheduler at {address} is gone: start one and run the command again; it continues "
        "with the remaining runs"
    )
    assert lines == []
    assert capfd.readouterr() == ("", "")
