"""The loop of a study: hands out jobs to Dask's workers and yields each as it finishes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from itertools import islice
from queue import SimpleQueue
from typing import TYPE_CHECKING, Any, NamedTuple

from keras_pendulum.errors import UserError, one_line
from keras_pendulum.study.job import Job, Reply

if TYPE_CHECKING:
    from distributed import Client, Future

ATTEMPTS = 3


class FinishedJob(NamedTuple):
    """A job that needs no more work: with a reply, or with the reason of its failure."""

    job: Job
    reply: Reply | None
    problem: str = ""


def run_all(
    client: Client,
    work: Callable[[Job], Reply],
    jobs: Iterable[Job],
    report: Callable[[str], None] = lambda line: None,
) -> Iterator[FinishedJob]:
    """Yields each job as it finishes, in no fixed order.

    Each worker has one job at a time, so that a killed worker interrupts no other job. A job that
    raises UserError has failed. After another exception it is repeated, up to three attempts. Dask
    repeats the job of a lost worker, up to a limit of its scheduler. `report` gets a line for each
    lost worker and each repeated job.

    Raises UserError when the connection to the scheduler is lost.
    """
    waiting = iter(jobs)
    running: dict[Any, tuple[Future[Reply], Job, int]] = {}  # by Dask's key
    events: SimpleQueue[Any] = SimpleQueue()  # finished futures, and messages of the scheduler
    address = client.scheduler_info()["address"]
    client.subscribe_topic("all", lambda event: events.put(event[1]))
    workers = set(client.nthreads())

    def start(job: Job, attempt: int = 1) -> None:
        future = client.submit(work, job, pure=False)
        running[future.key] = future, job, attempt
        future.add_done_callback(events.put)

    def start_waiting() -> None:
        for job in islice(waiting, max(0, max(1, len(workers)) - len(running))):
            start(job)

    start_waiting()
    while running:
        event = events.get()
        if isinstance(event, dict):
            if event.get("action") == "add-worker":
                workers.add(event["worker"])
            elif event.get("action") == "remove-worker":
                workers.discard(event["worker"])
                lost = [str(running[key][1]) for key in event["processing-tasks"] if key in running]
                if lost or not event["expected"]:
                    interrupted = f", interrupting {'; '.join(lost)}" if lost else ""
                    report(f"lost the worker {event['worker']}{interrupted}")
            start_waiting()
            continue
        future, job, attempt = running.pop(event.key)
        reply, problem, repeatable = _outcome(future)
        if reply is None and client.status != "running":
            raise lost_scheduler(address)
        if repeatable and attempt < ATTEMPTS:
            report(f"{job}: repeated after {problem}")
            start(job, attempt + 1)
            continue
        future.release()  # else Dask makes it again when its worker is lost
        start_waiting()  # before the caller writes this result
        yield FinishedJob(job, reply, problem)


def _outcome(future: Future[Reply]) -> tuple[Reply | None, str, bool]:
    """Returns a finished job's reply or its problem, and whether another attempt may help."""
    from distributed import KilledWorker

    try:
        return future.result(), "", False
    except UserError as error:
        return None, str(error), False
    except KilledWorker as error:
        return None, f"it lost its worker {error.allowed_failures + 1} times", False
    except Exception as error:
        return None, one_line(f"{type(error).__name__}: {' '.join(str(error).split())}"), True


def lost_scheduler(address: str) -> UserError:
    """Returns the error to raise when the connection to the scheduler is lost."""
    return UserError(
        f"the scheduler at {address} is gone: start one and run the command again; it continues "
        "with the remaining runs"
    )
