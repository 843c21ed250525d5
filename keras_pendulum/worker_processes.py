"""Worker processes of this machine as an executor that outlives them.

`ProcessPoolExecutor` breaks as a whole when one of its workers is killed, and takes the runs of the
others along. Here a worker that dies costs its own call alone, and the next call gets a new one.
"""

from __future__ import annotations

import multiprocessing
import os
import queue
import signal
import threading
from collections.abc import Callable
from concurrent.futures import Executor, Future
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from typing import Any

from keras_pendulum.backend import keep_to_one_thread
from keras_pendulum.errors import UserError

# Fresh processes, because TensorFlow does not survive a fork.
_SPAWN = multiprocessing.get_context("spawn")
_Call = tuple[Callable[..., Any], tuple[Any, ...], dict[str, Any]]


class WorkerDiedError(Exception):
    """A worker process ended in the middle of a call."""


class CallFailedError(Exception):
    """A call raised something; the message tells its kind and its own message."""


class WorkerProcesses(Executor):
    """An executor of spawned processes that compute on one thread each.

    A call's UserError is raised as it is, any other exception as CallFailedError.

    Args:
        count: how many processes; each is started by the first call that needs it.
    """

    def __init__(self, count: int) -> None:
        # Started by a lane, it would let SIGINT through there again.
        resource_tracker.ensure_running()
        self._calls: queue.SimpleQueue[tuple[Future[Any], _Call] | None] = queue.SimpleQueue()
        self._lanes = [_Lane(self._calls) for _ in range(count)]

    def submit(self, function: Callable[..., Any], /, *args: Any, **named: Any) -> Future[Any]:
        """Queues a call; function and arguments must pickle."""
        future: Future[Any] = Future()
        self._calls.put((future, (function, args, named)))
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Ends the processes: after the calls that wait, or, with `cancel_futures`, at once."""
        if cancel_futures:
            try:
                while item := self._calls.get_nowait():
                    item[0].cancel()
            except queue.Empty:
                pass
        for _ in self._lanes:
            self._calls.put(None)
        for lane in self._lanes:
            if cancel_futures:
                lane.kill()
            if wait:
                lane.join()


class _Lane(threading.Thread):
    """A thread that makes calls in one process, and in the next one when that has died."""

    def __init__(self, calls: queue.SimpleQueue[tuple[Future[Any], _Call] | None]) -> None:
        super().__init__(daemon=True)
        self._calls = calls
        self._process: Any = None  # multiprocessing names no type for a spawned one
        self._pipe: Connection | None = None
        self._killed = False
        self._starting = threading.Lock()  # so that no process starts unseen by kill()
        self.start()

    def run(self) -> None:
        # A terminal sends Ctrl-C to the workers too, but the study's own process answers it. They
        # start with this thread's mask, so that it does not find them while they still import.
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        while (item := self._calls.get()) is not None:
            future, call = item
            if not future.set_running_or_notify_cancel():
                continue
            try:
                future.set_result(self._answer(call))
            except BaseException as error:
                future.set_exception(error)
        if self._pipe is not None:
            self._pipe.close()  # which the worker takes as the end
            self._process.join()

    def kill(self) -> None:
        with self._starting:
            self._killed = True
            if self._process is not None:
                self._process.kill()

    def _answer(self, call: _Call) -> Any:
        if self._pipe is None:
            self._start_process()
        assert self._pipe is not None
        try:
            self._pipe.send(call)
            done, answer = self._pipe.recv()
        except (EOFError, OSError):
            self._process.join()
            self._pipe.close()
            self._pipe = None
            raise WorkerDiedError(f"the worker {_ending(self._process.exitcode)}") from None
        if done:
            return answer
        raise answer

    def _start_process(self) -> None:
        with self._starting:
            if self._killed:
                raise WorkerDiedError("the workers have been ended")
            self._pipe, theirs = _SPAWN.Pipe()
            self._process = _SPAWN.Process(target=_serve, args=(theirs,), daemon=True)
            self._process.start()
            theirs.close()  # else its end would not be seen here


def _ending(code: int | None) -> str:
    if code is not None and code < 0:
        return f"was killed by {signal.Signals(-code).name}"
    return f"ended with status {code}"


def _serve(pipe: Connection) -> None:
    """What a worker process does: one call after the other, until nobody asks any more."""
    keep_to_one_thread()
    threading.Thread(target=_end_with_parent, daemon=True).start()
    while True:
        try:
            function, args, named = pipe.recv()
        except EOFError:
            return
        try:
            answer = True, function(*args, **named)
        except UserError as error:
            answer = False, error
        except Exception as error:  # which need not pickle
            answer = False, CallFailedError(f"{type(error).__name__}: {error}")
        pipe.send(answer)


def _end_with_parent() -> None:
    """A killed study leaves no worker behind that learns on for nobody."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    wait([parent.sentinel])
    os._exit(1)
