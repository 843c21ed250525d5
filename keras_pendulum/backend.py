"""Keras runs on TensorFlow here, with the same arithmetic on every machine."""

from __future__ import annotations

import contextlib
import ctypes
import gc
import importlib
import os
import sys
from collections.abc import Iterator
from types import ModuleType
from typing import Any

from keras_pendulum.errors import UserError

_ENVIRONMENT = {
    "KERAS_BACKEND": "tensorflow",
    # How many threads share a matrix product decides how its sums are rounded, and one rounded
    # digit can part two runs: with one thread learning does not depend on the number of cores.
    "TF_NUM_INTRAOP_THREADS": "1",
    # oneDNN picks its kernels by the processor and rounds differently with each.
    "TF_ENABLE_ONEDNN_OPTS": "0",
    "TF_CPP_MIN_LOG_LEVEL": "3",  # its start-up notes help nobody here
}


def prepare_environment() -> None:
    """Sets what TensorFlow reads when it is imported; what the user has set stays.

    It has no effect on a TensorFlow that is in use already.
    """
    for name, value in _ENVIRONMENT.items():
        os.environ.setdefault(name, value)


def keep_to_one_thread() -> None:
    """Has every library of this process compute on one thread; to be called before their import.

    Workers beside each other would otherwise wait for one another's threads. What the user has set
    does not stay: the results of all workers of a study must be the same.
    """
    os.environ.update(_ENVIRONMENT)
    for name in ("OMP_NUM", "OPENBLAS_NUM", "MKL_NUM", "TF_NUM_INTEROP"):
        os.environ[f"{name}_THREADS"] = "1"


def keeps_to_one_thread() -> bool:
    """Whether this process is to do nothing beside what it does: what `keep_to_one_thread` asks."""
    return os.environ.get("TF_NUM_INTEROP_THREADS") == "1"


def require_tensorflow() -> None:
    """Raises UserError when Keras was asked to run on another backend."""
    backend = os.environ["KERAS_BACKEND"]
    if backend != "tensorflow":
        raise UserError(
            f"KERAS_BACKEND is {backend!r}, but this package runs on TensorFlow: unset it"
        )


@contextlib.contextmanager
def quick_import() -> Iterator[None]:
    """Imports of TensorFlow and Keras go faster within.

    TensorFlow makes so many objects that live until the end that the garbage collector, looking
    through them again and again and once more at exit, takes longer than half of the import itself.
    And Keras imports pyplot for galleries of images, which nobody here shows; it gets it for those.
    """
    imported, enabled = "tensorflow" in sys.modules, gc.isenabled()
    gc.disable()
    try:
        with _when_used("matplotlib.patches", "matplotlib.pyplot"):
            yield
    finally:
        if enabled:
            gc.enable()
        if not imported and "tensorflow" in sys.modules:
            gc.freeze()


class _WhenUsed(ModuleType):
    """Stands for a module, which is imported once something of it is asked for."""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):  # the import system's questions
            raise AttributeError(name)
        self.remove()
        return getattr(importlib.import_module(self.__name__), name)

    def remove(self) -> None:
        """Makes room for the module itself."""
        if sys.modules.get(self.__name__) is self:
            del sys.modules[self.__name__]


@contextlib.contextmanager
def _when_used(*names: str) -> Iterator[None]:
    """What imports these modules within gets each when it first uses it."""
    stand_ins = [_WhenUsed(name) for name in names]
    for stand_in in stand_ins:
        sys.modules.setdefault(stand_in.__name__, stand_in)
    try:
        yield
    finally:
        for stand_in in stand_ins:
            stand_in.remove()


def give_back_freed_memory() -> None:
    """Returns to the system what was freed, where its C library can (the GNU one does).

    Most of what compiling takes is freed, and would stay with this process.
    """
    with contextlib.suppress(AttributeError, OSError, TypeError):
        ctypes.CDLL(None).malloc_trim(0)
