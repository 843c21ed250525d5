"""Agents in the user's own code: `file.py:name` and `package.module:name` on the command line."""

from __future__ import annotations

import importlib
import importlib.util
import re
import sys
from pathlib import Path
from traceback import extract_tb
from types import ModuleType
from typing import Any

from keras_pendulum.errors import UserError, did_you_mean

_FORM = re.compile(r"(?P<place>.+\.py|\w+(\.\w+)*):(?P<name>[^\W\d]\w*)", re.DOTALL)


def names_code(word: str) -> bool:
    """Returns whether a word has the form `file.py:name`, `package.module:name` or `file.py`.

    Another file of that very name is no code.
    """
    if word.endswith(".py"):
        return True
    return _FORM.fullmatch(word) is not None and not Path(word).is_file()


def load_code(word: str) -> Any:
    """Runs the file, or imports the module, and returns the object of that name.

    Raises UserError when there is no such file, module or name, when the word has no name, and when
    the code fails.
    """
    form = _FORM.fullmatch(word)
    if form is None:
        raise UserError(f"{word}: names a file, but no agent in it; expected {word}:NAME")
    place, name = form["place"], form["name"]
    # The code may import what lies beside it, as it may when Python runs it.
    folder = str(Path(place).parent.resolve() if place.endswith(".py") else Path.cwd())
    if folder not in sys.path:
        sys.path.insert(0, folder)
    module = _run_file(Path(place)) if place.endswith(".py") else _import(place)
    if not hasattr(module, name):
        raise UserError(f"{place}: has no {name}{did_you_mean(name, vars(module))}")
    return getattr(module, name)


def _run_file(path: Path) -> ModuleType:
    if not path.is_file():
        raise UserError(f"{path}: no such file; expected FILE.py:NAME")
    spec = importlib.util.spec_from_file_location(f"_agent_{path.stem}", path)
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    sys.modules[module.__name__] = module  # pickles and dataclasses look there
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise _failure(str(path), error) from error
    return module


def _import(name: str) -> ModuleType:
    try:
        return importlib.import_module(name)
    except Exception as error:
        if isinstance(error, ModuleNotFoundError) and f"{name}.".startswith(f"{error.name}."):
            raise UserError(f"{name}: no such module; expected PACKAGE.MODULE:NAME") from error
        raise _failure(name, error) from error


def _failure(place: str, error: Exception) -> UserError:
    frame = extract_tb(error.__traceback__)[-1]
    line = f"{Path(frame.filename).name}, line {frame.lineno}"
    return UserError(f"{place}: raised {type(error).__name__}: {error} ({line})")
