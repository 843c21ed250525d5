"""TensorFlow's environment variables, and its import."""

from __future__ import annotations

import gc
import os
import subprocess
import sys

from keras_pendulum.tensorflow_setup import fast_import

CODE = "import os, keras_pendulum; print(os.environ['TF_NUM_INTRAOP_THREADS'])"


def threads(**environment: str) -> str:
    clean = {name: value for name, value in os.environ.items() if not name.startswith("TF_")}
    return subprocess.check_output(
        [sys.executable, "-c", CODE], env=clean | environment, text=True
    ).strip()


def test_tensorflow_uses_one_thread_unless_the_user_sets_another_number() -> None:
    assert threads() == "1"
    assert threads(TF_NUM_INTRAOP_THREADS="2") == "2"


def test_fast_import_restores_the_garbage_collector() -> None:
    with fast_import():
        assert not gc.isenabled()
    assert gc.isenabled()
    gc.disable()
    try:
        with fast_import():
            pass
        assert not gc.isenabled()
    finally:
        gc.enable()


def test_first_use_of_a_public_name_imports_without_garbage_collection() -> None:
    code = (
        "import gc, keras_pendulum\n"
        "collections = []\n"
        "gc.callbacks.append(lambda phase, info: collections.append(phase))\n"
        "keras_pendulum.DQN\n"
        "assert not collections and gc.isenabled() and gc.get_freeze_count() > 100_000\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
