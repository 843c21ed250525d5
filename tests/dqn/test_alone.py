"""The room `dqn` needs no other room, so its parts work in any program."""

from __future__ import annotations

import ast
import sys
from pathlib import Path

import pytest

import keras_pendulum

FILES = sorted((Path(keras_pendulum.__file__).parent / "dqn").glob("*.py"))
ALLOWED = {"numpy", "keras", "tensorflow", *sys.stdlib_module_names}


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_module_imports_numpy_keras_tensorflow_and_its_own_room_only(file: Path) -> None:
    imported: list[str] = []
    for node in ast.walk(ast.parse(file.read_text("utf-8"))):
        if isinstance(node, ast.ImportFrom):
            imported.append(node.module or "")
        elif isinstance(node, ast.Import):
            imported += [alias.name for alias in node.names]
    for name in imported:
        assert name.split(".")[0] in ALLOWED or name.startswith("keras_pendulum.dqn."), name
