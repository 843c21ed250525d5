"""TensorFlow's environment variables, and its import."""

from __future__ import annotations

import gc
import json
import os
import re
import shlex
import subprocess
import sys
import sysconfig
import warnings

import pytest
from conftest import ROOT

import keras_pendulum as kp
from keras_pendulum.tensorflow_setup import _ENVIRONMENT, fast_import

CODE = """
import json, os, sys
import keras_pendulum
assert "numpy" not in sys.modules  # which would read its variable too early
print(json.dumps({name: os.environ[name] for name in sys.argv[1:]}))
"""
AFTER_TENSORFLOW = """
import os, sys, types
sys.modules["tensorflow"] = types.ModuleType("tensorflow")
import keras_pendulum
from keras_pendulum.tensorflow_setup import warn_if_not_reproducible
print(sorted(name for name in os.environ if name.startswith(("TF_", "XLA_", "TENSORFLOW_"))))
for _ in range(2):
    warn_if_not_reproducible()
"""
# Prints the sum of the bytes of Q-values, which differ with the number of threads.
Q_VALUES = """
import sys, zlib
import keras_pendulum
from keras_pendulum import tensorflow_setup
if "worker" in sys.argv:
    tensorflow_setup.use_one_thread()
import numpy as np
from keras_pendulum.dqn.policy import GreedyPolicy
random = np.random.RandomState(0)
shapes = (3, 512), (512,), (512, 256), (256,), (256, 128), (128,), (128, 41), (41,)
policy = GreedyPolicy([random.randn(*shape).astype("f") / 8 for shape in shapes], "tanh")
print(zlib.crc32(policy.q_values(random.randn(100, 3).astype("f")).tobytes()))
"""
# Prints the sum of the bytes of trained weights.
TRAINING = """
import zlib
import keras_pendulum as kp
config = kp.preset("reference", episodes=6, warmup_episodes=1, updates_per_episode=40)
network = kp.train_dqn(config).network
print(zlib.crc32(b"".join(weights.tobytes() for weights in network.get_weights())))
"""
OWN = {
    "TENSORFLOW_USE_CUSTOM_CONTRACTION_KERNEL": "1",
    "TF_ENABLE_ONEDNN_OPTS": "1",
    "TF_NUM_INTRAOP_THREADS": "4",
    "XLA_FLAGS": "",
}


def run(code: str, *words: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Runs code in a process without variables of TensorFlow and NumPy."""
    clean = {
        name: value
        for name, value in os.environ.items()
        if name not in _ENVIRONMENT and not name.startswith("TF_")
    }
    return subprocess.run(
        [sys.executable, "-c", code, *words],
        env=clean | environment,
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.parametrize("own", [{}, OWN])
def test_import_sets_the_variables_that_the_user_has_not_set(own: dict[str, str]) -> None:
    assert json.loads(run(CODE, *_ENVIRONMENT, **own).stdout) == _ENVIRONMENT | own


@pytest.mark.skipif(os.cpu_count() == 1, reason="needs two cores to compute on two threads")
def test_a_batch_has_the_q_values_of_a_worker_of_a_study() -> None:
    assert run(Q_VALUES).stdout == run(Q_VALUES, "worker").stdout != ""


@pytest.mark.skipif("XLA_FLAGS" not in _ENVIRONMENT, reason="is for x86-64")
def test_a_processor_with_shorter_vectors_trains_the_same_weights() -> None:
    flags = _ENVIRONMENT["XLA_FLAGS"]
    older = flags.replace("AVX", "SSE4_2")
    assert older != flags
    assert run(TRAINING).stdout == run(TRAINING, XLA_FLAGS=older).stdout != ""


def test_tensorflow_imported_before_is_left_alone_with_one_warning() -> None:
    done = run(AFTER_TENSORFLOW)
    assert done.stdout == "[]\n"
    assert done.stderr.count("TensorFlow was imported before keras_pendulum") == 1
    words = shlex.split(done.stderr.partition("or set ")[2].partition(" first (")[0])
    assert dict(word.split("=", 1) for word in words).items() <= _ENVIRONMENT.items() and words
    # The user's own settings need no warning, and neither does a package that is imported first.
    done = run(AFTER_TENSORFLOW, **OWN)
    assert (done.stdout, done.stderr) == (f"{sorted(OWN)}\n", "")
    code = AFTER_TENSORFLOW.replace("import os, sys", "import keras_pendulum, os, sys")
    assert run(code).stderr == ""


def test_warning_comes_with_a_training_and_not_with_an_evaluation(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("keras_pendulum.tensorflow_setup._MAY_ROUND_OTHERWISE", True)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        kp.evaluate_policy(kp.DQN((8,)), 1)
    with pytest.warns(UserWarning, match="TensorFlow was imported before"):
        kp.train_dqn(kp.preset("original", episodes=1, hidden_units=(8,)))


def test_document_names_each_variable_with_its_value() -> None:
    text = (ROOT / "docs" / "reproducibility.md").read_text(encoding="utf-8")
    named = dict(re.findall(r"^\| `([A-Z_]+)` \| (.+?) \|", text, re.MULTILINE))
    assert _ENVIRONMENT.items() <= named.items()
    if sysconfig.get_platform() == "linux-x86_64":  # the last one only with AVX2
        assert named.keys() - _ENVIRONMENT.keys() <= {"OPENBLAS_CORETYPE"}


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
    done = run(code)
    assert done.returncode == 0, done.stderr


NOTES = """\
WARNING: All log messages before absl::InitializeLog() is called are written to STDERR
I0000 00:00:1795466974.767995    4604 cudart_stub.cc:31] Could not find cuda drivers on your machine
W0000 00:00:1795466974.767996    4604 computation_placer.cc:177] already registered
E0000 00:00:1795466974.767997    4604 cuda_fft.cc:467] Unable to register cuFFT factory
"""
OTHERS = """\
F0000 00:00:1795466974.767998    4604 cpu_feature_guard.cc:100] compiled to use AVX instructions
Error: I0000 is not a note
I am a line of the user's program
"""


def write_in_fast_import(before: str = "", then: str = "", **environment: str) -> str:
    """Writes NOTES and OTHERS as C++ code does, while `fast_import`; returns what is printed."""
    code = f"""
import os, sys, keras_pendulum
from keras_pendulum.tensorflow_setup import fast_import
{before}
with fast_import():
    os.write(2, {(NOTES + OTHERS).encode()!r})
    {then}
os.write(2, b"I0000 1 2 a.cc:3] a note later")
"""
    done = run(code, **environment)
    return done.stderr + done.stdout


@pytest.mark.quick
def test_notes_of_tensorflow_are_removed_and_nothing_else() -> None:
    assert write_in_fast_import() == f"{OTHERS}I0000 1 2 a.cc:3] a note later"


@pytest.mark.quick
@pytest.mark.parametrize(
    ("before", "environment"),
    [("", {"TF_CPP_MIN_LOG_LEVEL": "0"}), ("sys.modules['tensorflow'] = os", {})],
    ids=["the user's own log level", "TensorFlow is imported already"],
)
def test_notes_remain(before: str, environment: dict[str, str]) -> None:
    assert write_in_fast_import(before, **environment).startswith(NOTES + OTHERS)


@pytest.mark.quick
def test_other_lines_of_a_failing_import_are_printed_before_its_error() -> None:
    printed = write_in_fast_import(then="raise ImportError('a broken TensorFlow')")
    assert printed.startswith(f"{OTHERS}Traceback")
    assert printed.endswith("ImportError: a broken TensorFlow\n")


@pytest.mark.quick
@pytest.mark.parametrize(
    "before",
    ["os.dup2(1, 7); os.close(2)", "import tempfile; tempfile.tempdir = '/no/such/folder'"],
    ids=["standard error closed", "no file can be written"],
)
def test_import_succeeds_where_notes_cannot_be_removed(before: str) -> None:
    then = "os.write(1, b'imported')"
    if "close" in before:
        before += "; os.write = lambda file, text: None if file == 2 else os.writev(file, [text])"
    assert "imported" in write_in_fast_import(before, then)
