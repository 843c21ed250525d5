"""Registers DQN with Keras as soon as Keras is imported, so that Keras can load a file with it.

The package need not import Keras itself, which takes seconds.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType

_MODULE = "keras_pendulum.dqn.network"  # its import registers DQN


class _KerasFinder(MetaPathFinder):
    """A finder that adds the import of DQN's module to the import of Keras."""

    def find_spec(
        self, name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Returns the spec that another finder returns for Keras; None for other modules."""
        if name != "keras":
            return None
        others = (finder for finder in sys.meta_path if finder is not self)
        specs = (finder.find_spec(name, path, target) for finder in others)
        spec = next(filter(None, specs), None)
        if spec is not None and spec.loader is not None:
            execute = spec.loader.exec_module

            def exec_module(module: ModuleType) -> None:
                execute(module)
                importlib.import_module(_MODULE)

            spec.loader.exec_module = exec_module  # type: ignore[method-assign]
        return spec


def register_with_keras() -> None:
    """Registers DQN at once where Keras is imported already, else at its import."""
    if "keras" in sys.modules:
        importlib.import_module(_MODULE)
    else:
        sys.meta_path.insert(0, _KerasFinder())
