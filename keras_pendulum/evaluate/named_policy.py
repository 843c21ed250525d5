"""The policy that a word of the command line names: a file, or an agent in the user's own code."""

from __future__ import annotations

import importlib
import importlib.util
import os
import re
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

from numpy.typing import ArrayLike

from keras_pendulum.errors import UserError, did_you_mean
from keras_pendulum.evaluate.answers import failure
from keras_pendulum.evaluate.policy import Policy
from keras_pendulum.evaluate.sources import as_policy, load_keras_file
from keras_pendulum.storage.find_weights import find_weights

_CODE = re.compile(r"(?P<place>.+\.py|\w+(\.\w+)*):(?P<name>[^\W\d]\w*)", re.DOTALL)


def named_policy(
    word: str,
    torques: ArrayLike | None = None,
    activation: str | None = None,
    environment: str | None = None,
) -> Policy:
    """Returns the policy that a word of the command line names.

    The word is a file, the name of a shipped one, `file.py:name` or `package.module:name`. The last
    two run the user's code. See `as_policy` for the torques and the environment, and
    `load_weights` for the activation.

    Raises UserError for a word that names no agent, and when the user's code fails.
    """
    if not names_code(word):
        path = os.fspath(find_weights(word))
        return as_policy(load_keras_file(path, activation), torques, path, environment)
    if activation is not None:
        raise UserError("--activation belongs to a weights file; your code has its own")
    try:
        policy = as_policy(_load_code(word), torques, environment=environment)
    except TypeError as error:
        raise UserError(f"{word}: {error}") from error
    policy.name = word
    return policy


def names_code(word: str) -> bool:
    """Returns whether a word has the form `file.py:name`, `package.module:name` or `file.py`.

    A file of that very name is not code.
    """
    is_code = bool(_CODE.fullmatch(word)) or ".py:" in word
    return word.endswith(".py") or (is_code and not Path(word).is_file())


def _load_code(word: str) -> Any:
    """Runs the file, or imports the module, and returns the object of that name."""
    form = _CODE.fullmatch(word)
    file, is_named, code = word.partition(".py:")
    if form is None and is_named:
        raise UserError(
            f"{word}: expected FILE.py:NAME; write `agent = {code or '…'}` in {file}.py, and give "
            f"{file}.py:agent"
        )
    if form is None:
        raise UserError(f"{word}: names a file, but no agent in it; expected {word}:NAME")
    place, name = form["place"], form["name"]
    is_file = place.endswith(".py")
    # The code may import what lies beside it, as it may when Python runs it.
    folder = str(Path(place).parent.resolve() if is_file else Path.cwd())
    if folder not in sys.path:
        sys.path.insert(0, folder)
    if is_file and not Path(place).is_file():
        raise UserError(f"{place}: no such file; expected FILE.py:NAME")
    try:
        module = _run_file(Path(place)) if is_file else importlib.import_module(place)
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        missing = isinstance(error, ModuleNotFoundError) and f"{place}.".startswith(
            f"{error.name}."
        )
        if missing and not is_file:
            raise UserError(f"{place}: no such module; expected PACKAGE.MODULE:NAME") from error
        advice = ""
        if isinstance(error, SystemExit):
            advice = '; what the file does as a program belongs below `if __name__ == "__main__":`'
        raise UserError(f"{place}: {failure(error)}{advice}") from error
    if not hasattr(module, name):
        raise UserError(f"{place}: has no {name}{did_you_mean(name, vars(module))}")
    return getattr(module, name)


def _run_file(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(f"_agent_{path.stem}", path)
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    sys.modules[module.__name__] = module  # pickles and dataclasses look there
    spec.loader.exec_module(module)
    return module
