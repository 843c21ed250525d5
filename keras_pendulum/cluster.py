"""The workers of a Dask cluster as a study's engine."""

from __future__ import annotations

import importlib.util
import logging
import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

from keras_pendulum.errors import UserError
from keras_pendulum.study_loop import Engine
from keras_pendulum.study_run import require_versions

_SECONDS_TO_ANSWER = 10
_SECONDS_FOR_A_WORKER = 60
# So many runs wait at the scheduler that workers which join later find some too.
_IN_FLIGHT = 2000


@contextmanager
def dask_cluster(address: str, versions: dict[str, str]) -> Iterator[Engine]:
    """Connects to the scheduler at `address`, such as tcp://10.0.0.1:8786.

    Raises UserError when it cannot be reached, has no worker within a minute, when a worker or the
    scheduler has other versions than `versions`, or a worker more than one thread: its runs would
    share one TensorFlow.
    """
    if importlib.util.find_spec("distributed") is None:
        raise UserError("distributed is not installed: pip install 'keras_pendulum[cluster]'")
    from distributed import Client, KilledWorker

    unreachable = UserError(
        f"no scheduler answers at {address}: start one by `dask scheduler`, and name the address "
        "that it prints"
    )
    if not re.fullmatch(r"((tcp|tls|wss?)://)?[^\s/]+:\d+", address):
        raise unreachable  # Dask's client would complain of it when it is thrown away
    # What it logs of lost connections is told here in one line.
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    try:
        client = Client(address, timeout=_SECONDS_TO_ANSWER, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        raise unreachable from error
    try:
        try:
            client.wait_for_workers(1, timeout=_SECONDS_FOR_A_WORKER)
        except TimeoutError as error:
            raise UserError(
                f"the scheduler at {address} has no worker: start some by "
                f"`dask worker {address} --nthreads 1 --nworkers N`"
            ) from error
        _require_fit_machines(client, versions)

        def require() -> None:
            if client.status != "running":
                raise UserError(
                    f"the scheduler at {address} has gone: no result is lost, and with a scheduler "
                    "the same command goes on"
                )

        yield Engine(
            # Dask itself makes a run again whose worker is lost, four times.
            client.get_executor(pure=False),
            _IN_FLIGHT,
            lambda: sum(client.nthreads().values()),
            require,
            (KilledWorker,),
        )
    finally:
        with suppress(OSError):
            client.close(timeout=_SECONDS_TO_ANSWER)


def _require_fit_machines(client: Any, versions: dict[str, str]) -> None:
    answers: dict[str, Any]
    for worker, threads in client.nthreads().items():
        if threads != 1:
            raise UserError(
                f"the worker {worker} has {threads} threads: start workers with --nthreads 1, one "
                "for each core"
            )

    def found() -> dict[str, str]:  # sent as it is, so that it runs where the package is missing
        try:
            from keras_pendulum.study_result import installed_versions
        except ImportError:
            import keras_pendulum

            return {"keras_pendulum": keras_pendulum.__version__}
        return installed_versions()

    # The scheduler unpickles what it hands out, so it needs the package too.
    try:
        answers = {"the scheduler": client.run_on_scheduler(found)}
    except Exception as error:
        answers = {"the scheduler": error}
    for worker, answer in client.run(found, on_error="return").items():
        answers[f"the worker {worker}"] = answer
    for who, answer in answers.items():
        if isinstance(answer, BaseException):
            told = " ".join(str(answer).split())
            raise UserError(f"{who} cannot make runs: {told}") from answer
        require_versions(versions, answer, who)
