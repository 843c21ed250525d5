"""The hooks into the import of Keras and TensorFlow."""

from __future__ import annotations

import contextlib
import importlib
import importlib.util
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import keras_pendulum as kp
from keras_pendulum.import_hooks import ImportHook

LOAD = """
import numpy as np
{imports}
network = keras.models.load_model({path!r})
np.save({path!r} + ".npy", network(np.ones((2, 3), np.float32)))
"""

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
linux = pytest.mark.skipif(sys.platform != "linux", reason="only there TensorFlow has GPU notes")


@pytest.fixture
def module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """Returns the name of a module that can be imported, with the list `events`."""
    (tmp_path / "hooked_module.py").write_text("events = ['module']", encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "meta_path", sys.meta_path.copy())
    yield "hooked_module"
    sys.modules.pop("hooked_module", None)


@pytest.mark.quick
def test_hook_puts_the_import_of_its_module_into_a_with_block(module: str) -> None:
    events = []

    @contextlib.contextmanager
    def context() -> Iterator[None]:
        events.append("before")
        yield
        events.extend([*sys.modules[module].events, "after"])

    sys.meta_path.insert(0, ImportHook(module, context))
    assert importlib.util.find_spec(module) is not None  # a mere search has no effect
    assert importlib.util.find_spec("no_such_module") is None
    assert events == []
    for _ in range(2):
        assert importlib.import_module(module).__name__ == module
    assert events == ["before", "module", "after"]


@pytest.mark.quick
def test_hook_finds_no_module_that_is_missing() -> None:
    hook = ImportHook("no_such_module", contextlib.nullcontext)
    assert hook.find_spec("no_such_module", None) is None


@pytest.mark.parametrize(
    "imports", ["import keras_pendulum, keras", "import keras, keras_pendulum"]
)
def test_keras_loads_a_saved_network_where_the_package_is_imported(
    imports: str, tmp_path: Path
) -> None:
    network = kp.DQN((8,), activation="relu", seed=3)
    path = str(tmp_path / "a.keras")
    network.save(path)
    subprocess.run([sys.executable, "-c", LOAD.format(imports=imports, path=path)], check=True)
    np.testing.assert_array_equal(np.load(path + ".npy"), network(np.ones((2, 3), np.float32)))


def import_tensorflow(
    folder: Path, then: str = "", before: str = "", **environment: str
) -> subprocess.CompletedProcess[str]:
    """Imports a module `tensorflow` that prints NOTES and OTHERS as C++ code does."""
    code = f"import os\nos.write(2, {NOTES.encode()!r} + {OTHERS.encode()!r})\n{then}\n"
    (folder / "tensorflow.py").write_text(code, encoding="utf-8")
    lines = (
        *("import os, sys, keras_pendulum", f"sys.path.insert(0, {str(folder)!r})", before),
        *("print('before', file=sys.stderr)", "import tensorflow"),
        *("print('after', file=sys.stderr)", "os.write(2, b'I0000 1 2 a.cc:3] a note later')"),
    )
    clean = {name: value for name, value in os.environ.items() if not name.startswith("TF_")}
    return subprocess.run(
        [sys.executable, "-c", "\n".join(lines)],
        env=clean | environment,
        capture_output=True,
        text=True,
        check=False,
    )


@linux
@pytest.mark.quick
def test_start_notes_of_tensorflow_are_removed_and_nothing_else(tmp_path: Path) -> None:
    done = import_tensorflow(tmp_path)
    assert done.returncode == 0
    assert done.stderr == f"before\n{OTHERS}after\nI0000 1 2 a.cc:3] a note later"


@linux
@pytest.mark.quick
@pytest.mark.parametrize(
    ("level", "remaining"), [("0", "WIWE"), ("1", "WE"), ("2", "E"), ("x", "WIWE")]
)
def test_users_own_log_level_says_which_notes_are_removed(
    level: str, remaining: str, tmp_path: Path
) -> None:
    done = import_tensorflow(tmp_path, TF_CPP_MIN_LOG_LEVEL=level)
    printed = done.stderr.removeprefix("before\n").partition("F0000")[0]
    assert "".join(line[0] for line in printed.splitlines()) == remaining


@linux
@pytest.mark.quick
@pytest.mark.parametrize(
    ("then", "status", "end"),
    [
        ("os.write(2, b'the last words')\nos.abort()", -signal.SIGABRT, "the last words"),
        ("raise ImportError('a broken TensorFlow')", 1, "ImportError: a broken TensorFlow\n"),
        ("os._exit(7)", 7, "program\n"),
    ],
    ids=["crash", "error", "exit"],
)
def test_message_of_a_failing_import_is_printed(
    then: str, status: int, end: str, tmp_path: Path
) -> None:
    done = import_tensorflow(tmp_path, then)
    assert done.returncode == status
    assert done.stderr.startswith(f"before\n{OTHERS}")
    assert done.stderr.endswith(end)


@linux
@pytest.mark.quick
@pytest.mark.parametrize(
    "before",
    ["os.close(2)\nos.write = print", "sys.executable = '/no/such/python'"],
    ids=["standard error closed", "no process starts"],
)
def test_import_succeeds_where_notes_cannot_be_removed(before: str, tmp_path: Path) -> None:
    done = import_tensorflow(tmp_path, before=f"{before}\nsys.stderr = sys.stdout")
    assert done.returncode == 0
    assert "before\n" in done.stdout and "after\n" in done.stdout


@linux
@pytest.mark.quick
def test_import_does_not_wait_for_a_process_that_it_has_started(tmp_path: Path) -> None:
    done = import_tensorflow(
        tmp_path,
        then="import subprocess\nprocess = subprocess.Popen(['sleep', '600'])",
        before="import atexit, keras_pendulum.import_hooks as hooks\nhooks._LONGEST_WAIT = 0.01\n"
        "atexit.register(lambda: tensorflow.process.kill())",
    )
    assert done.returncode == 0
    assert OTHERS in done.stderr
    assert NOTES[:20] not in done.stderr
