"""Context managers around the import of TensorFlow and of Keras, whoever imports them."""

from __future__ import annotations

import contextlib
import functools
import importlib
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType

# A line of the C++ library absl, such as "I0000 00:00:1795466974.767995    4604 port.cc:153] …".
_NOTE = r"WARNING: All log messages before absl::|[{}]\d+ [\d:.]+ +\d+ [^ ]+:\d+\] "
_COPY_OTHER_LINES = """
import re, sys
note = re.compile(sys.argv[1].encode())
for line in sys.stdin.buffer:
    if not note.match(line):
        sys.stdout.buffer.write(line)
        sys.stdout.buffer.flush()
"""
_LONGEST_WAIT = 5.0  # seconds, for the last lines


class ImportHook(MetaPathFinder):
    """A finder that puts the import of one module into a `with` block.

    Args:
        module: the name of the module, which is not imported yet.
        context: returns the context manager.
    """

    def __init__(self, module: str, context: Callable[[], AbstractContextManager[None]]) -> None:
        self._module = module
        self._context = context

    def find_spec(
        self, name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Returns the spec that another finder returns for the module; None for other modules."""
        if name != self._module:
            return None
        others = [finder for finder in sys.meta_path if finder is not self]
        specs = (finder.find_spec(name, path, target) for finder in others)
        spec = next(filter(None, specs), None)
        if spec is not None and spec.loader is not None:
            execute = spec.loader.exec_module

            def exec_module(module: ModuleType) -> None:
                with self._context():
                    execute(module)

            spec.loader.exec_module = exec_module  # type: ignore[method-assign]
        return spec


def add_import_hooks(network_module: str) -> None:
    """Lets the import of TensorFlow print no start-up notes, and that of Keras register DQN.

    Args:
        network_module: the module of DQN. Keras then loads a file with this class, and this package
            need not import Keras itself, which takes seconds.
    """
    if sys.platform == "linux":  # the only system where TensorFlow has code for GPUs
        sys.meta_path.insert(0, ImportHook("tensorflow", without_start_notes))
    if "keras" in sys.modules:
        importlib.import_module(network_module)
    else:
        register = functools.partial(_import_afterwards, network_module)
        sys.meta_path.insert(0, ImportHook("keras", register))


@contextlib.contextmanager
def _import_afterwards(module: str) -> Iterator[None]:
    """Imports a module at the end of the `with` block."""
    yield
    importlib.import_module(module)


@contextlib.contextmanager
def without_start_notes() -> Iterator[None]:
    """Removes TensorFlow's start-up notes from the standard error while it is imported.

    TensorFlow prints some before it reads TF_CPP_MIN_LOG_LEVEL, such as that there is no GPU. They
    are removed as that variable says: at 1 the notes, at 2 warnings too, at 3 errors too. All other
    lines are printed, also the last ones of a crash, because another process copies them.
    """
    import subprocess

    level = os.environ.get("TF_CPP_MIN_LOG_LEVEL", "")
    severities = "IWE"[: int(level)] if level.isdecimal() else ""
    process = None
    if severities:
        with contextlib.suppress(OSError):  # the standard error is closed, or no process starts
            os.fstat(2)
            process = subprocess.Popen(
                [sys.executable, "-P", "-S", "-c", _COPY_OTHER_LINES, _NOTE.format(severities)],
                stdin=subprocess.PIPE,
                stdout=2,
                start_new_session=True,  # Ctrl-C in the terminal is for this process alone
            )
    if process is None:
        yield
        return
    assert process.stdin
    stderr = os.dup(2)
    os.dup2(process.stdin.fileno(), 2)
    process.stdin.close()
    try:
        yield
    finally:
        os.dup2(stderr, 2)
        os.close(stderr)
        with contextlib.suppress(subprocess.TimeoutExpired):  # another process has inherited it
            process.wait(_LONGEST_WAIT)
