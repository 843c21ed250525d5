"""The workers of a study: processes of this machine, or those of a Dask cluster."""

from __future__ import annotations

import logging
import multiprocessing
import re
import signal
import sys
import threading
import warnings
from asyncio import CancelledError
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from multiprocessing import resource_tracker
from typing import TYPE_CHECKING, Any

from keras_pendulum.errors import UserError
from keras_pendulum.study.job import require_versions
from keras_pendulum.study.runner import ATTEMPTS, lost_scheduler
from keras_pendulum.tensorflow_setup import use_one_thread

if TYPE_CHECKING:
    from distributed import Client, LocalCluster

_ANSWER_SECONDS = 10
_FIRST_WORKER_SECONDS = 60
_LOCAL_SETTINGS = {
    "distributed.scheduler.allowed-failures": ATTEMPTS - 1,  # of a job's workers
    # A killed worker is replaced however long that takes on a busy machine.
    "distributed.deploy.lost-worker-timeout": "1 day",
    "distributed.worker.profile.enabled": False,  # it would interrupt a run 100 times a second
}
# Windows has no masks of signals: there, each worker executes this to ignore Ctrl-C.
_IGNORE_CONTROL_C = "import signal\nsignal.signal(signal.SIGINT, signal.SIG_IGN)\n"


@contextmanager
def local_workers(count: int) -> Iterator[Client]:
    """Starts a scheduler in this process, reachable from this machine only, and `count` workers.

    Each worker is a process that computes on one thread.

    Raises UserError when no worker has started within a minute.
    """
    use_one_thread()  # the workers inherit the environment, and import NumPy before their first run
    import dask
    from distributed import Client

    _start_resource_tracker()
    with _silent_dask(), dask.config.set(_LOCAL_SETTINGS), ExitStack() as stack:
        # Dask's threads inherit the mask, and from them the workers: a terminal sends Ctrl-C to
        # the workers too, but only this process responds.
        with _control_c_delayed():
            cluster = _start_cluster()
            stack.callback(_kill_workers_and_close, cluster)
            cluster.scale(count)  # the workers start in the background
            # By address: `Client(cluster)` would wait for all workers.
            client = Client(cluster.scheduler_address, set_as_default=False)
            stack.callback(_close, client)
        _wait_for_worker(
            client,
            f"no worker has started within {_FIRST_WORKER_SECONDS} s: look for a full disk or "
            "memory, and try --workers 1",
        )
        yield client


@contextmanager
def cluster_workers(address: str, versions: dict[str, str]) -> Iterator[Client]:
    """Connects to the Dask scheduler at `address`, such as tcp://10.0.0.1:8786.

    Raises UserError when it cannot be reached, when it has no worker within a minute, when it or a
    worker has other versions than `versions`, or when a worker has several threads: its runs would
    share one TensorFlow. Raises UserError too when the scheduler is lost in the `with` block.
    """
    from distributed import Client

    unreachable = UserError(
        f"no scheduler answers at {address}: start one with `dask scheduler`, and give the address "
        "that it prints"
    )
    if not re.fullmatch(r"((tcp|tls|wss?)://)?[^\s/]+:\d+", address):
        raise unreachable  # Dask would print a traceback when its client is deleted
    with _silent_dask(), ExitStack() as stack:
        try:
            client = Client(address, timeout=_ANSWER_SECONDS, set_as_default=False)
        except (OSError, ValueError, TypeError) as error:
            raise unreachable from error
        stack.callback(_close, client)
        stack.enter_context(_report_lost_scheduler(client, address))
        _wait_for_worker(
            client,
            f"the scheduler at {address} has no worker: start some with "
            f"`dask worker {address} --nthreads 1 --nworkers N`",
        )
        for worker, threads in client.nthreads().items():
            if threads != 1:
                raise UserError(
                    f"the worker {worker} has {threads} threads: start workers with --nthreads 1, "
                    "one for each core"
                )
        _require_same_versions(client, versions)
        yield client


def dashboard(client: Client) -> str | None:
    """Returns the address of the scheduler's dashboard; None where bokeh is not installed."""

    def has_dashboard() -> bool:
        return "distributed.dashboard.scheduler" in sys.modules

    return client.dashboard_link if client.run_on_scheduler(has_dashboard) else None


def _wait_for_worker(client: Client, problem: str) -> None:
    """Raises UserError with the problem when there is no worker within a minute."""
    try:
        client.wait_for_workers(1, timeout=_FIRST_WORKER_SECONDS)
    except TimeoutError as error:
        raise UserError(problem) from error


@contextmanager
def _report_lost_scheduler(client: Client, address: str) -> Iterator[None]:
    """Raises UserError for an error in the `with` block, if the scheduler is lost."""
    try:
        yield
    except UserError:
        raise
    except (Exception, CancelledError) as error:
        if client.status == "running" and _answers(client):
            raise
        raise lost_scheduler(address) from error


def _answers(client: Client) -> bool:
    try:
        client.run_on_scheduler(int)
    except (Exception, CancelledError):
        return False
    return True


def _require_same_versions(client: Client, versions: dict[str, str]) -> None:
    def find_versions() -> dict[str, str]:  # sent by value: the package may be missing there
        from keras_pendulum.study.job import installed_versions

        return installed_versions()

    answers: dict[str, Any] = {}
    # The scheduler unpickles the jobs, so it needs the package too.
    try:
        answers["the scheduler"] = client.run_on_scheduler(find_versions)
    except Exception as error:
        answers["the scheduler"] = error
    for worker, answer in client.run(find_versions, on_error="return").items():
        answers[f"the worker {worker}"] = answer
    for who, answer in answers.items():
        if isinstance(answer, BaseException):
            problem = " ".join(str(answer).split())
            raise UserError(f"{who} cannot make runs: {problem}") from answer
        require_versions(versions, answer, who)


def _start_cluster() -> LocalCluster:
    from distributed import LocalCluster

    try:
        return LocalCluster(
            n_workers=0,
            threads_per_worker=1,
            host="127.0.0.1",
            dashboard_address="127.0.0.1:0",
            memory_limit=None,  # Dask would pause or restart a worker at a share of the memory
            silence_logs=logging.CRITICAL,
            preload=_IGNORE_CONTROL_C if sys.platform == "win32" else None,
        )
    except RuntimeError as error:
        problem = " ".join(str(error).split())
        raise UserError(f"cannot start a Dask scheduler on this machine: {problem}") from error


def _close(client: Client) -> None:
    # Without its scheduler, the client can end with an error of any type.
    with _control_c_delayed(), suppress(Exception, CancelledError):
        client.close(timeout=_ANSWER_SECONDS)


def _kill_workers_and_close(cluster: LocalCluster) -> None:
    """Closes the cluster without waiting for the runs that its workers compute."""
    with _control_c_delayed():
        for nanny in cluster.workers.values():
            nanny.close_gracefully()  # a killed worker is not replaced
        closing = threading.Thread(target=cluster.close)
        closing.start()
        while closing.is_alive():
            for process in multiprocessing.active_children():
                process.kill()
            closing.join(0.05)


def _start_resource_tracker() -> None:
    """Starts the helper process of `multiprocessing` before a Dask thread does.

    The helper unblocks SIGINT in the thread that starts it, and it would print a warning when the
    study is killed. Windows has no such helper.
    """
    if sys.platform != "win32":
        sys.warnoptions.append("ignore:resource_tracker:UserWarning")
        resource_tracker.ensure_running()
        sys.warnoptions.pop()


@contextmanager
def _control_c_delayed() -> Iterator[None]:
    """Delays Ctrl-C to the end of the `with` block; threads that start in it never get it."""
    if sys.platform == "win32":  # it has no masks, and only the main thread gets Ctrl-C
        yield
        return
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)


@contextmanager
def _silent_dask() -> Iterator[None]:
    """Suppresses Dask's log messages and warnings: the study prints its own line per problem."""
    before = logging.root.manager.disable
    logging.disable(logging.CRITICAL)
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", module="distributed")
            yield
    finally:
        logging.disable(before)
