"""A DQN for the inverted pendulum: a student's original and the same design without its defects.

The names below are the public API. The first use of one imports what it needs.
"""

from __future__ import annotations

import importlib
import sys
from types import ModuleType
from typing import TYPE_CHECKING, Any

from keras_pendulum.keras_registration import register_with_keras
from keras_pendulum.tensorflow_setup import (
    fast_import,
    require_tensorflow,
    set_environment_defaults,
)
from keras_pendulum.version import __version__

if TYPE_CHECKING:
    from keras_pendulum.config.config import Config
    from keras_pendulum.config.presets import preset
    from keras_pendulum.diagnose.diagnosis import Diagnosis, diagnose
    from keras_pendulum.dqn.network import DQN
    from keras_pendulum.errors import ConfigError, UserError, WeightsError
    from keras_pendulum.evaluate.evaluation import evaluate_policy
    from keras_pendulum.evaluate.loaded_policy import Policy, load_policy
    from keras_pendulum.evaluate.q_functions import q_function
    from keras_pendulum.evaluate.score import Score
    from keras_pendulum.optimum.optimal_return import optimal_return
    from keras_pendulum.storage.find_weights import find_weights
    from keras_pendulum.storage.weights import load_weights, save_weights
    from keras_pendulum.train.train_dqn import TrainingResult, train_dqn

__all__ = [
    "DQN",
    "Config",
    "ConfigError",
    "Diagnosis",
    "Policy",
    "Score",
    "TrainingResult",
    "UserError",
    "WeightsError",
    "__version__",
    "diagnose",
    "evaluate_policy",
    "find_weights",
    "load_policy",
    "load_weights",
    "optimal_return",
    "preset",
    "q_function",
    "save_weights",
    "train_dqn",
]

_MODULES = {
    "config.config": ("Config",),
    "config.presets": ("preset",),
    "diagnose.diagnosis": ("Diagnosis", "diagnose"),
    "dqn.network": ("DQN",),
    "errors": ("ConfigError", "UserError", "WeightsError"),
    "evaluate.evaluation": ("evaluate_policy",),
    "evaluate.loaded_policy": ("Policy", "load_policy"),
    "evaluate.q_functions": ("q_function",),
    "evaluate.score": ("Score",),
    "optimum.optimal_return": ("optimal_return",),
    "storage.find_weights": ("find_weights",),
    "storage.weights": ("load_weights", "save_weights"),
    "train.train_dqn": ("TrainingResult", "train_dqn"),
}


class _Package(ModuleType):
    """This package, in which the room `diagnose` does not hide the function of the same name."""

    def __setattr__(self, name: str, value: Any) -> None:
        # The import of a room sets it as an attribute here.
        if not (name == "diagnose" and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
set_environment_defaults()
register_with_keras()


def __getattr__(name: str) -> Any:
    for module, names in _MODULES.items():
        if name in names:
            require_tensorflow()
            with fast_import():
                found = importlib.import_module(f"keras_pendulum.{module}")
            # The import binds the name of the room, which would hide the function `diagnose`.
            for each in names:
                globals()[each] = getattr(found, each)
            return globals()[name]
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
