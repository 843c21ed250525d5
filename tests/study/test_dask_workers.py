"""Worker processes of this machine, and those of a Dask scheduler."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from functools import partial
from pathlib import Path
from threading import Thread
from types import SimpleNamespace
from typing import Any

import psutil
import pytest
from conftest import TESTS, environment_restored, running_module, wait_for
from distributed import LocalCluster
from test_results_folder import make_job

from keras_pendulum.errors import UserError
from keras_pendulum.study import dask_workers
from keras_pendulum.study.dask_workers import cluster_workers, dashboard, local_workers
from keras_pendulum.study.job import Job, Reply, installed_versions
from keras_pendulum.study.runner import lost_scheduler, run_all

IMPORTED_FROM = [str(TESTS), str(Path(__file__).parent)]  # workers unpickle functions of this file


@pytest.fixture(autouse=True)
def patient(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Lets a busy machine start its workers; restores the environment."""
    monkeypatch.setattr(dask_workers, "_ANSWER_SECONDS", 600)
    monkeypatch.setattr(dask_workers, "_FIRST_WORKER_SECONDS", 600)
    with environment_restored():
        yield


def describe_worker(job: Job) -> Reply:
    """Returns a number of threads that Dask does not set by itself, and the worker's process."""
    return Reply(os.environ.get("TF_NUM_INTEROP_THREADS", "").encode(), 0, 0, 0, str(os.getpid()))


FAILURES = {0: 99, 1: 1}  # killed workers by seed


def kill_worker(folder: Path, job: Job) -> Reply:
    """Kills the worker in the first attempts of some seeds; counts the attempts in files."""
    attempts = folder / str(job.config.seed)
    with open(attempts, "a", encoding="utf-8") as file:
        file.write("x")
    if len(attempts.read_text(encoding="utf-8")) <= FAILURES.get(job.config.seed, 0):
        psutil.Process().kill()
    return describe_worker(job)


def never_end(started: Path, job: Job) -> Reply:
    started.touch()
    while True:
        time.sleep(1)


def test_job_of_a_killed_worker_is_repeated_up_to_three_times_and_no_other_job(
    tmp_path: Path,
) -> None:
    lines: list[str] = []
    with local_workers(1) as client:
        work = partial(kill_worker, tmp_path)
        finished = list(run_all(client, work, map(make_job, range(3)), lines.append))
    problems = {each.job.config.seed: each.problem for each in finished}
    assert problems == {0: "it lost its worker 3 times", 1: "", 2: ""}
    assert [len((tmp_path / str(seed)).read_text()) for seed in range(3)] == [3, 2, 1]
    lost = r"lost the worker tcp://127.0.0.1:\d+, interrupting arm, seed (\d)"
    assert sorted(re.sub(lost, r"\1", line) for line in lines) == ["0", "0", "0", "1"]


def listening_sockets() -> set[tuple[str, int]]:
    this_process = psutil.Process()
    return {
        (connection.laddr.ip, connection.laddr.port)
        for process in [this_process, *this_process.children(recursive=True)]
        for connection in process.net_connections("inet")
        if connection.status == psutil.CONN_LISTEN
    }


def test_local_workers_use_one_thread_and_only_this_machine_reaches_them() -> None:
    before = listening_sockets()
    with local_workers(1) as client:
        finished = list(run_all(client, describe_worker, map(make_job, range(3))))
        assert {address for address, _ in listening_sockets() - before} == {"127.0.0.1"}
        assert dashboard(client) is None
    assert {each.reply.result for each in finished if each.reply} == {b"1"}
    assert len({each.reply.worker for each in finished if each.reply}) == 1


def test_workers_on_windows_ignore_control_c(monkeypatch: pytest.MonkeyPatch) -> None:
    def handler() -> str:  # sent by value: conftest.py would set the handler
        return str(signal.getsignal(signal.SIGINT))

    monkeypatch.setattr(dask_workers, "sys", SimpleNamespace(platform="win32"))
    with local_workers(1) as client:
        assert list(client.run(handler).values()) == [str(signal.SIG_IGN)]


def test_end_of_local_workers_does_not_wait_for_their_jobs(tmp_path: Path) -> None:
    work = partial(never_end, tmp_path / "started")
    before = psutil.Process().children()
    with local_workers(1) as client:
        future = client.submit(work, make_job(0))
        wait_for((tmp_path / "started").exists)
        del future
    remaining = [child for child in psutil.Process().children() if child not in before]
    assert not [child for child in remaining if "spawn_main" in " ".join(child.cmdline())]


def running(module: str, *words: str | Path) -> AbstractContextManager[subprocess.Popen[bytes]]:
    folders = [*IMPORTED_FROM, os.environ.get("PYTHONPATH")]
    return running_module(
        module,
        *words,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, folders))},
    )


@contextmanager
def running_scheduler(folder: Path) -> Iterator[tuple[subprocess.Popen[bytes], str]]:
    """Yields a scheduler's process and its address."""
    file = folder / "scheduler.json"
    words = ["--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(file)]
    with running("distributed.cli.dask_scheduler", *words) as process:
        wait_for(lambda: file.exists() and file.read_text().endswith("}"))
        yield process, json.loads(file.read_text())["address"]


def running_worker(
    address: str, *words: str | Path
) -> AbstractContextManager[subprocess.Popen[bytes]]:
    options = ["--no-nanny", "--nthreads", "1", *words]
    return running("distributed.cli.dask_worker", address, *options)


@contextmanager
def cluster_of_this_process(workers: int = 1, threads: int = 1) -> Iterator[str]:
    """Yields the address of a scheduler whose workers are threads of this process."""
    with LocalCluster(
        n_workers=workers,
        threads_per_worker=threads,
        processes=False,
        protocol="tcp://",
        host="127.0.0.1",
        dashboard_address=None,
    ) as cluster:
        yield cluster.scheduler_address


def refusal(address: str, versions: dict[str, str]) -> str:
    with pytest.raises(UserError) as caught, cluster_workers(address, versions):
        pass
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_unsuitable_cluster_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    versions = installed_versions()
    with cluster_of_this_process(workers=0) as address, monkeypatch.context() as impatient:
        impatient.setattr(dask_workers, "_FIRST_WORKER_SECONDS", 0.1)
        assert refusal(address, versions) == (
            f"the scheduler at {address} has no worker: start some with "
            f"`dask worker {address} --nthreads 1 --nworkers N`"
        )
    with cluster_of_this_process(threads=2) as address:
        assert "has 2 threads: start workers with --nthreads 1" in refusal(address, versions)
    with cluster_of_this_process() as address:
        other = {**versions, "numpy": "1.0"}
        assert "the scheduler has numpy 2" in refusal(address, other)
        # Also where only the workers differ.
        monkeypatch.setattr("distributed.Client.run_on_scheduler", lambda self, function: other)
        assert "the worker tcp://127.0.0.1:" in refusal(address, other)


def test_scheduler_that_does_not_answer_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dask_workers, "_ANSWER_SECONDS", 0.2)  # nobody could answer later
    for address in ("tcp://127.0.0.1:1", "no such place"):
        assert refusal(address, {}).startswith(f"no scheduler answers at {address}: start one")


@pytest.mark.parametrize(
    ("moment", "end"),
    [
        ("before the first run", subprocess.Popen.kill),
        ("during a run", subprocess.Popen.kill),
        ("during a run", subprocess.Popen.terminate),
        ("after the last run", subprocess.Popen.kill),
    ],
)
def test_lost_scheduler_is_one_error(
    moment: str,
    end: Callable[[subprocess.Popen[bytes]], None],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    check = dask_workers._require_same_versions
    lines: list[str] = []
    with running_scheduler(tmp_path) as (scheduler, address), running_worker(address):

        def stop_scheduler(client: Any) -> None:
            client._timeout = 0  # of the attempts to connect again
            end(scheduler)
            scheduler.wait()

        def stop_during_a_run() -> None:
            wait_for((tmp_path / "started").exists)
            end(scheduler)

        def check_versions(client: Any, versions: dict[str, str]) -> None:
            if moment == "before the first run":
                stop_scheduler(client)
            check(client, versions)

        monkeypatch.setattr(dask_workers, "_require_same_versions", check_versions)
        with (
            pytest.raises(UserError) as caught,
            cluster_workers(address, installed_versions()) as client,
        ):
            if moment == "during a run":
                Thread(target=stop_during_a_run).start()
                work = partial(never_end, tmp_path / "started")
                list(run_all(client, work, [make_job(0)], lines.append))
            assert len(list(run_all(client, describe_worker, [make_job(0)]))) == 1
            stop_scheduler(client)
            client.nthreads()
    assert str(caught.value) == (
        f"the scheduler at {address} is gone: start one and run the command again; it continues "
        "with the remaining runs"
    )
    assert lines == []
    assert capfd.readouterr() == ("", "")


def test_lost_scheduler_is_reported_by_a_client_that_still_runs_and_fails_at_its_end(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fail(*arguments: object, **named: object) -> None:
        raise RuntimeError

    with cluster_of_this_process() as address:
        with (
            pytest.raises(UserError) as caught,
            cluster_workers(address, installed_versions()) as client,
        ):
            monkeypatch.setattr(client, "close", fail)
            monkeypatch.setattr(client, "run_on_scheduler", fail)
            assert client.status == "running"
            raise OSError("Timed out trying to connect")
        monkeypatch.undo()
        client.close()
    assert str(caught.value) == str(lost_scheduler(address))


def test_other_error_is_not_reported_as_a_lost_scheduler() -> None:
    with (
        cluster_of_this_process() as address,
        pytest.raises(ZeroDivisionError),
        cluster_workers(address, installed_versions()) as client,
    ):
        client.run(lambda: 1 / 0)
