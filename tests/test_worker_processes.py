"""Worker processes outlive one another, and so do the runs of a study."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import pytest

from keras_pendulum import study_loop
from keras_pendulum.errors import UserError
from keras_pendulum.presets import preset
from keras_pendulum.study_loop import Engine, run_all
from keras_pendulum.study_result import Job, Result, encode
from keras_pendulum.study_run import Outcome
from keras_pendulum.worker_processes import CallFailedError, WorkerDiedError, WorkerProcesses


def die() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def fail(error: Exception) -> None:
    raise error


def sleep_and_return(path: Path) -> int:
    path.touch()
    time.sleep(0.5)
    return os.getpid()


def test_a_killed_worker_costs_its_own_call_alone(tmp_path: Path) -> None:
    with WorkerProcesses(2) as workers:
        other = workers.submit(sleep_and_return, tmp_path / "begun")
        with pytest.raises(WorkerDiedError, match="killed by SIGKILL"):
            workers.submit(die).result(60)
        assert other.result(60) != os.getpid()
        assert workers.submit(abs, -3).result(60) == 3


def test_a_call_that_raises_leaves_its_worker_at_work() -> None:
    with WorkerProcesses(1) as workers:
        first = workers.submit(os.getpid).result(60)
        with pytest.raises(UserError, match="told"):
            workers.submit(fail, UserError("told")).result(60)
        with pytest.raises(CallFailedError, match="ValueError: oops"):
            workers.submit(fail, ValueError("oops")).result(60)
        assert workers.submit(os.getpid).result(60) == first
        assert workers.submit(os.getenv, "OMP_NUM_THREADS").result(60) == "1"


def test_ending_the_workers_does_not_wait_for_their_calls() -> None:
    workers = WorkerProcesses(1)
    long, queued = workers.submit(time.sleep, 600), workers.submit(os.getpid)
    workers.submit(os.getpid)
    while not long.running():
        time.sleep(0.01)
    workers.shutdown(cancel_futures=True)
    assert isinstance(long.exception(60), WorkerDiedError)
    assert queued.cancelled()


def test_a_worker_at_work_ends_with_the_process_that_asked_it() -> None:
    call = "import time\nprint('begun', flush=True)\ntime.sleep(100)"
    code = (
        "from keras_pendulum.worker_processes import WorkerProcesses\n"
        f"WorkerProcesses(1).submit(exec, {call!r}).result()"
    )
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"begun\n"
        process.kill()
        # Its output, which the worker shares, is not at an end before both are.
        assert process.communicate(timeout=50)[0] == b""


def job(seed: int) -> Job:
    return Job("arm", "arm", preset("reference", seed=seed), {})


class Flaky:
    """Work that fails the first so many times for each seed."""

    def __init__(self, error: Exception, times: dict[int, int]) -> None:
        self.error, self.left, self.made = error, times, list[int]()

    def __call__(self, job: Job) -> Outcome:
        seed = job.config.seed
        self.made.append(seed)
        if self.left.get(seed, 0) > 0:
            self.left[seed] -= 1
            raise self.error
        return Outcome(encode(job, Result(0.0, [0.0], [], [])), 0, 0, 0, "here")


def test_a_run_that_dies_is_made_up_to_three_times_and_the_others_go_on() -> None:
    work = Flaky(OSError("gone"), {1: 2, 2: 99})
    with ThreadPoolExecutor(1) as executor:
        engine = Engine(executor, 2, lambda: 1)
        ended = {each.job.config.seed: each for each in run_all(engine, work, map(job, range(5)))}
    assert sorted(work.made) == [0, 1, 1, 1, 2, 2, 2, 3, 4]
    assert [seed for seed, each in ended.items() if each.outcome is None] == [2]
    assert ended[2].problem == "OSError: gone"


@pytest.mark.parametrize(
    ("error", "told"),
    [(UserError("the loss is nan"), "the loss is nan"), (OSError("gone"), "OSError: gone")],
)
def test_a_users_mistake_is_not_tried_again_nor_what_the_engine_holds_hopeless(
    error: Exception, told: str
) -> None:
    work = Flaky(error, {0: 99})
    with ThreadPoolExecutor(1) as executor:
        (ended,) = run_all(Engine(executor, 2, lambda: 1, hopeless=(OSError,)), work, [job(0)])
    assert (work.made, ended.outcome, ended.problem) == ([0], None, told)


def test_a_run_that_fails_because_the_engine_has_gone_is_not_tried_again() -> None:
    work = Flaky(OSError("gone"), {0: 99})
    with ThreadPoolExecutor(1) as executor:
        engine = Engine(executor, 2, lambda: 1, partial(fail, UserError("no engine")))
        with pytest.raises(UserError, match="no engine"):
            list(run_all(engine, work, [job(0)]))
    assert work.made == [0]


def test_an_engine_that_has_gone_is_noticed_while_no_run_ends(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(study_loop, "_PATIENCE", 0.01)
    noticed = threading.Event()

    def require() -> None:
        noticed.set()
        raise UserError("no engine")

    def work(job: Job) -> Outcome:
        noticed.wait(20)
        return Flaky(OSError(), {})(job)

    with ThreadPoolExecutor(1) as executor, pytest.raises(UserError, match="no engine"):
        list(run_all(Engine(executor, 1, lambda: 1, require), work, [job(0)]))


def test_runs_are_handed_out_a_few_at_a_time() -> None:
    handed = []

    def jobs() -> object:
        for seed in range(1000):
            handed.append(seed)
            yield job(seed)

    with ThreadPoolExecutor(1) as executor:
        runs = run_all(Engine(executor, 3, lambda: 1), Flaky(OSError(), {}), jobs())  # type: ignore[arg-type]
        next(runs)
        assert len(handed) <= 4
        assert len(list(runs)) == 999
