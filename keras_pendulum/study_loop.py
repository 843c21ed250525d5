"""Runs handed out to workers, a bounded number at a time; one that dies is tried again."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future
from itertools import islice
from queue import Empty, SimpleQueue
from typing import Any, NamedTuple

from keras_pendulum.errors import UserError
from keras_pendulum.study_result import Job
from keras_pendulum.study_run import Outcome

ATTEMPTS = 3
_PATIENCE = 2.0  # seconds without a run's end, after which the engine is asked whether it is there


class Engine(NamedTuple):
    """Where runs are made."""

    executor: Executor
    in_flight: int  # how many runs to hand out at a time
    workers: Callable[[], int]  # how many are there now
    require: Callable[[], None] = lambda: None  # raises UserError when it has gone as a whole
    hopeless: tuple[type[BaseException], ...] = ()  # failures that another attempt cannot mend


class Ended(NamedTuple):
    """A run that needs no more work: with an outcome, or with what went wrong each time."""

    job: Job
    outcome: Outcome | None
    problem: str = ""


def run_all(
    engine: Engine,
    work: Callable[[Job], Outcome],
    jobs: Iterable[Job],
    on_retry: Callable[[Job, str], None] = lambda job, problem: None,
) -> Iterator[Ended]:
    """Yields each run as it ends, in no certain order.

    A run that fails or loses its worker is made up to three times. One that raises UserError would
    do so again, and is not. Raises UserError when the engine has gone as a whole.
    """
    waiting = iter(jobs)
    ended: SimpleQueue[Future[Outcome]] = SimpleQueue()
    running: dict[Future[Outcome], tuple[Job, int]] = {}

    def start(job: Job, attempt: int = 1) -> None:
        future: Future[Any] = engine.executor.submit(work, job)
        running[future] = job, attempt
        future.add_done_callback(ended.put)

    for job in islice(waiting, engine.in_flight):
        start(job)
    while running:
        try:
            future = ended.get(timeout=_PATIENCE)
        except Empty:
            engine.require()
            continue
        job, attempt = running.pop(future)
        problem = _problem(future)
        if problem is not None:
            engine.require()
        final = isinstance(problem, (UserError, *engine.hopeless)) or attempt == ATTEMPTS
        if problem is not None and not final:
            on_retry(job, _told(problem))
            start(job, attempt + 1)
            continue
        # The worker goes on before the caller writes the result.
        for following in islice(waiting, 1):
            start(following)
        if problem is None:
            yield Ended(job, future.result())
        else:
            yield Ended(job, None, _told(problem))


def _problem(future: Future[Outcome]) -> BaseException | None:
    try:
        return future.exception()
    except Exception as error:  # it was cancelled, as Dask does with runs that it has lost
        return error


def _told(problem: BaseException) -> str:
    text = " ".join(str(problem).split())
    return text if isinstance(problem, UserError) else f"{type(problem).__name__}: {text}"
