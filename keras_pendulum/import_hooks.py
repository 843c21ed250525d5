"""Hooks into the import of Keras, whoever imports it."""

from __future__ import annotations

import contextlib
import functools
import importlib
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType


class ImportHook(MetaPathFinder):
    """A finder that puts the import of one module into a `with` block.

    Args:
        module: the name of the module, which is not imported yet.
        context: returns the context manager.
    """

    def __init__(self, module: str, context: Callable[[], AbstractContextManager[None]]) -> None:
        self._module = module
        self._context = context

    def find_spec(
        self, name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Returns the spec that another finder returns for the module; None for other modules."""
        if name != self._module:
            return None
        others = [finder for finder in sys.meta_path if finder is not self]
        specs = (finder.find_spec(name, path, target) for finder in others)
        spec = next(filter(None, specs), None)
        if spec is not None and spec.loader is not None:
            execute = spec.loader.exec_module

            def exec_module(module: ModuleType) -> None:
                with self._context():
                    execute(module)

            spec.loader.exec_module = exec_module  # type: ignore[method-assign]
        return spec


def add_import_hooks(network_module: str) -> None:
    """Lets the import of Keras register DQN, whoever imports it.

    Args:
        network_module: the module of DQN. Keras then loads a file with this class, and this package
            need not import Keras itself, which takes seconds.
    """
    if "keras" in sys.modules:
        importlib.import_module(network_module)
    else:
        register = functools.partial(_import_afterwards, network_module)
        sys.meta_path.insert(0, ImportHook("keras", register))


@contextlib.contextmanager
def _import_afterwards(module: str) -> Iterator[None]:
    """Imports a module at the end of the `with` block."""
    yield
    importlib.import_module(module)
