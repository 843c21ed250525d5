"""Loads files in another process, which a crash or an endless loop may end.

    python tests/storage/load_files.py SECONDS

reads a path per line of its input, and prints a JSON object for each. The reader of a file may use
SECONDS of processor time. `Loader` starts this program and measures it.
"""

from __future__ import annotations

import hashlib
import json
import queue
import subprocess
import sys
import threading
import time
import warnings
from pathlib import Path
from typing import Any, NamedTuple

import psutil

_START = 300.0  # seconds for the import of TensorFlow
_MB = 1e6


class Outcome(NamedTuple):
    """The outcome of one load."""

    kind: str  # "refused", "loaded", "failed" (another exception), "crashed" or "endless"
    text: str  # the error, or the SHA-256 of the loaded network
    seconds: float
    memory: float  # MB, growth of the process that loads the file
    child_memory: float  # MB, of its child processes, beyond that for a sound file


class Loader:
    """A process that loads files. It starts anew after a crash and after an endless load.

    Args:
        sound: a file that loads. It is loaded first, so that imports do not count.
        endless: a load that takes more than these seconds counts as endless.
        processor_time: of the reader of a small file, in seconds.
    """

    def __init__(self, sound: Path, endless: float, processor_time: float) -> None:
        self._sound = sound
        self._endless = endless
        self._processor_time = processor_time
        self._process: subprocess.Popen[str] | None = None

    def __enter__(self) -> Loader:
        return self

    def __exit__(self, *error: object) -> None:
        self._end()

    def load(self, path: Path) -> Outcome:
        """Returns the outcome of `load_weights` for the file."""
        if self._process is None:
            self._start()
        return self._load(path, self._endless)

    def _start(self) -> None:
        self._process = subprocess.Popen(
            [sys.executable, __file__, str(self._processor_time)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            encoding="utf-8",
        )
        self._answers: queue.Queue[str] = queue.Queue()
        threading.Thread(target=self._read, args=(self._process,), daemon=True).start()
        self._memory_of_child = 0.0
        warm_up = self._load(self._sound, _START)
        assert warm_up.kind == "loaded", warm_up
        self._memory_of_child = self._load(self._sound, _START).child_memory

    def _read(self, process: subprocess.Popen[str]) -> None:
        answers = self._answers
        assert process.stdout is not None
        for line in process.stdout:
            answers.put(line)
        answers.put("")  # the process has ended

    def _load(self, path: Path, limit: float) -> Outcome:
        assert self._process is not None and self._process.stdin is not None
        process = psutil.Process(self._process.pid)
        before = _resident([process])
        growth = child_memory = listed = 0.0
        children: list[psutil.Process] = []
        started = time.perf_counter()
        self._process.stdin.write(json.dumps(str(path)) + "\n")
        self._process.stdin.flush()
        answer = None
        while answer is None and time.perf_counter() - started < limit:
            try:
                answer = self._answers.get(timeout=0.002)
            except queue.Empty:
                if time.perf_counter() - listed > 0.02:  # a list of all processes takes long
                    children, listed = _children(process), time.perf_counter()
            growth = max(growth, _resident([process]) - before)
            child_memory = max(child_memory, _resident(children))
        seconds = time.perf_counter() - started
        if answer:
            kind, text = json.loads(answer)
        else:
            kind, text = ("endless" if answer is None else "crashed"), ""
            self._end()
        return Outcome(kind, text, seconds, growth, child_memory - self._memory_of_child)

    def _end(self) -> None:
        if self._process is not None:
            for process in (*_children(psutil.Process(self._process.pid)), self._process):
                process.kill()
            self._process.wait()
            self._process = None


def _children(process: psutil.Process) -> list[psutil.Process]:
    """Returns the child processes. A fork that has not become another program is none of them."""
    try:
        name = process.cmdline()
        return [child for child in process.children(recursive=True) if child.cmdline() != name]
    except psutil.NoSuchProcess:
        return []


def _resident(processes: list[psutil.Process]) -> float:
    """Returns the resident memory of the processes that are alive, in MB."""
    total = 0.0
    for process in processes:
        try:
            total += process.memory_info().rss / _MB
        except psutil.NoSuchProcess:
            continue
    return total


def main() -> None:
    """Loads the files that standard input names."""
    import keras_pendulum as kp
    from keras_pendulum.storage import quarantine

    quarantine.SECONDS = float(sys.argv[1])
    warnings.simplefilter("ignore")
    for line in sys.stdin:
        try:
            answer = ("loaded", _digest(kp.load_weights(json.loads(line))))
        except kp.WeightsError as error:
            answer = ("refused", str(error))
        except Exception as error:
            answer = ("failed", repr(error))
        print(json.dumps(answer), flush=True)


def _digest(network: Any) -> str:
    digest = hashlib.sha256()
    digest.update(repr((network.hidden_units, network.activation, network.metadata)).encode())
    for array in network.get_weights():
        digest.update(array.tobytes())
    return digest.hexdigest()


if __name__ == "__main__":
    main()
