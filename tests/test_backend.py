from __future__ import annotations

import ctypes
import gc
import os
import subprocess
import sys

import pytest

from keras_pendulum.backend import give_back_freed_memory, quick_import

CODE = "import os, keras_pendulum; print(os.environ['TF_NUM_INTRAOP_THREADS'])"


def threads(**environment: str) -> str:
    clean = {name: value for name, value in os.environ.items() if not name.startswith("TF_")}
    return subprocess.check_output(
        [sys.executable, "-c", CODE], env=clean | environment, text=True
    ).strip()


def test_tensorflow_is_asked_for_one_thread_unless_the_user_has_chosen() -> None:
    assert threads() == "1"
    assert threads(TF_NUM_INTRAOP_THREADS="2") == "2"


def test_a_quick_import_leaves_the_garbage_collector_on() -> None:
    with quick_import():
        assert not gc.isenabled()
    assert gc.isenabled()


def test_a_c_library_that_keeps_freed_memory_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    give_back_freed_memory()
    monkeypatch.setattr(ctypes, "CDLL", lambda name: object())
    give_back_freed_memory()
