"""TensorFlow's start: its environment variables, its threads, and the cost of its import."""

from __future__ import annotations

import contextlib
import gc
import os
import sys
from collections.abc import Iterator

from keras_pendulum.errors import UserError

_ENVIRONMENT = {
    "KERAS_BACKEND": "tensorflow",
    # The number of threads of a matrix product changes its rounding, and one changed digit makes
    # another run. With one thread, a run does not depend on the number of cores.
    "TF_NUM_INTRAOP_THREADS": "1",
    # oneDNN chooses its kernels by the processor, and each rounds differently.
    "TF_ENABLE_ONEDNN_OPTS": "0",
    "TF_CPP_MIN_LOG_LEVEL": "3",  # no start-up notes
}


def set_environment_defaults() -> None:
    """Sets the variables that TensorFlow reads at its import; the user's own values stay.

    They have no effect on a TensorFlow that is already imported.
    """
    for name, value in _ENVIRONMENT.items():
        os.environ.setdefault(name, value)


def use_one_thread() -> None:
    """Limits every library of this process to one thread; call it before their import.

    The workers of a study would otherwise compete for the cores. It replaces the user's own values,
    because all workers of a study must compute the same results.
    """
    os.environ.update(_ENVIRONMENT)
    for name in ("OMP_NUM", "OPENBLAS_NUM", "MKL_NUM", "TF_NUM_INTEROP"):
        os.environ[f"{name}_THREADS"] = "1"


def require_tensorflow() -> None:
    """Raises UserError when the user has chosen another backend for Keras."""
    backend = os.environ["KERAS_BACKEND"]
    if backend != "tensorflow":
        raise UserError(
            f"KERAS_BACKEND is {backend!r}, but this package runs on TensorFlow: unset it"
        )


@contextlib.contextmanager
def fast_import() -> Iterator[None]:
    """Pauses garbage collection while TensorFlow and Keras are imported.

    Their import creates so many permanent objects that collecting takes two fifths of its time
    (benchmarks/import_time.py).
    """
    imported, enabled = "tensorflow" in sys.modules, gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()
        if not imported and "tensorflow" in sys.modules:
            gc.freeze()  # permanent objects are not examined again
