"""The hooks into the import of Keras and TensorFlow."""

from __future__ import annotations

import contextlib
import importlib
import importlib.util
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
