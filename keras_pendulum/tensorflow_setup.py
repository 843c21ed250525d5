"""TensorFlow's start: its environment variables, its threads, and the cost of its import."""

from __future__ import annotations

import contextlib
import gc
import os
import re
import shlex
import sys
import sysconfig
import warnings
from collections.abc import Iterator

from keras_pendulum.errors import UserError
from keras_pendulum.status import status

_ENVIRONMENT = {
    "KERAS_BACKEND": "tensorflow",
    # The number of threads of a matrix product changes its rounding, and one changed digit makes
    # another run. With a fixed number, a run does not depend on the number of cores. NumPy, which
    # computes the Q-values that choose an action, has OpenBLAS. Several threads of it would also
    # wait for each other with all their power where other processes need the cores.
    "TF_NUM_INTRAOP_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    # oneDNN chooses its kernels by the processor, and each rounds differently.
    "TF_ENABLE_ONEDNN_OPTS": "0",
    "TF_CPP_MIN_LOG_LEVEL": "3",  # no start-up notes
}
if sysconfig.get_platform().endswith(("x86_64", "amd64")):
    # Gradients are products of a kernel of oneDNN even so. It adds up the last rows of a block in
    # another order, and the blocks depend on the processor's cache. Eigen's kernel is as fast.
    _ENVIRONMENT["TENSORFLOW_USE_CUSTOM_CONTRACTION_KERNEL"] = "0"
    # XLA compiles for the processor. Without fused multiply-add (after AVX) its code rounds alike
    # everywhere, and without unrolled loops as that of the recorded runs.
    _ENVIRONMENT["XLA_FLAGS"] = (
        "--xla_cpu_max_isa=AVX --xla_backend_extra_options=xla_cpu_disable_loop_unrolling"
    )
if sys.platform == "linux":
    # By default SDL shows its pictures with OpenGL, whose driver may load an LLVM that crashes
    # together with TensorFlow's. SDL reads the variable when it makes its first window.
    _ENVIRONMENT["SDL_FRAMEBUFFER_ACCELERATION"] = "0"
    # OpenBLAS does not check whether the processor has the instructions of this choice.
    with contextlib.suppress(OSError), open("/proc/cpuinfo", "rb") as processors:
        if b" avx2 " in processors.read(4096):  # of the first one
            _ENVIRONMENT["OPENBLAS_CORETYPE"] = "Haswell"
# A line of the C++ library absl, such as "I0000 00:00:1795466974.767995    4604 port.cc:153] …".
_NOTE = re.compile(rb"WARNING: All log messages before absl::|[IWE]\d+ [\d:.]+ +\d+ [^ ]+:\d+\] ")
# TensorFlow reads these when it is imported, or at its first product.
_OF_TENSORFLOW = ("TF_", "XLA_", "TENSORFLOW_")
_ROUNDING = [
    name
    for name in _ENVIRONMENT
    if name.startswith(_OF_TENSORFLOW) and name != "TF_CPP_MIN_LOG_LEVEL"
]
# Whether the user has imported TensorFlow before this package, and without a choice of all these.
_IMPORTED_BEFORE = "tensorflow" in sys.modules
_MAY_ROUND_OTHERWISE = _IMPORTED_BEFORE and not os.environ.keys() >= set(_ROUNDING)
_forked_with_tensorflow = False


def _remember_fork() -> None:
    global _forked_with_tensorflow
    _forked_with_tensorflow = "tensorflow" in sys.modules


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_remember_fork)


def require_own_tensorflow() -> None:
    """Raises UserError in a fork of a process with TensorFlow: its threads are not in the fork."""
    if _forked_with_tensorflow:
        raise UserError(
            "training would hang here: this process is a fork of one that has imported TensorFlow; "
            'start it with multiprocessing.get_context("spawn")'
        )


def set_environment_defaults() -> None:
    """Sets the variables that TensorFlow, OpenBLAS and SDL read; the user's own values stay.

    A TensorFlow or a NumPy that was imported before this package stays as it is.
    """
    for name, value in _ENVIRONMENT.items():
        if not (_IMPORTED_BEFORE and name.startswith(_OF_TENSORFLOW)):
            os.environ.setdefault(name, value)


def warn_if_not_reproducible() -> None:
    """Warns before a training whose last digits may depend on the computer.

    They do where TensorFlow was imported before this package and chose its threads and its code.
    """
    if _MAY_ROUND_OTHERWISE:
        settings = " ".join(f"{name}={shlex.quote(_ENVIRONMENT[name])}" for name in _ROUNDING)
        warnings.warn(
            "TensorFlow was imported before keras_pendulum: on another computer this run may give "
            f"other numbers; import keras_pendulum first, or set {settings} first "
            "(docs/reproducibility.md)",
            stacklevel=1,  # this line, so that a process warns once
        )


def use_one_thread() -> None:
    """Limits every library of this process to one thread; call it before their import.

    The workers of a study would otherwise compete for the cores. It replaces the user's own values,
    because all workers of a study must compute the same results.
    """
    os.environ.update(_ENVIRONMENT)
    for name in ("OMP_NUM", "MKL_NUM", "TF_NUM_INTEROP"):
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
    """Imports TensorFlow and Keras in its `with` block, without garbage collection and notes.

    Their import creates so many permanent objects that collecting takes two fifths of its time
    (benchmarks/speed/import_time.py). Raises UserError as `require_tensorflow` does.
    """
    require_tensorflow()
    imported, enabled = "tensorflow" in sys.modules, gc.isenabled()
    gc.disable()
    try:
        if imported:
            yield
        else:
            with status("Loading TensorFlow"), _without_notes():
                yield
    finally:
        if enabled:
            gc.enable()
        if not imported and "tensorflow" in sys.modules:
            gc.freeze()  # permanent objects are not examined again


@contextlib.contextmanager
def _without_notes() -> Iterator[None]:
    """Removes TensorFlow's notes about GPUs from the standard error in its `with` block.

    TensorFlow prints them before it reads TF_CPP_MIN_LOG_LEVEL. All other lines are printed when
    the block ends. A user's own choice of that variable keeps the notes.
    """
    import tempfile

    if os.environ.get("TF_CPP_MIN_LOG_LEVEL") != _ENVIRONMENT["TF_CPP_MIN_LOG_LEVEL"]:
        yield
        return
    try:
        lines = tempfile.TemporaryFile()  # noqa: SIM115
        stderr = os.dup(2)
    except OSError:  # no file can be written, or standard error is closed
        yield
        return
    with lines:
        os.dup2(lines.fileno(), 2)
        try:
            yield
        finally:
            os.dup2(stderr, 2)
            os.close(stderr)
            lines.seek(0)
            for line in lines:
                if not _NOTE.match(line):
                    os.write(2, line)
