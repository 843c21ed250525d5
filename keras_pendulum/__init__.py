"""The inverted pendulum's DQN, faithful to the original and put right.

The names below are the package's whole outside; TensorFlow is imported when the first of them
that needs it is used.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from keras_pendulum.backend import prepare_environment, quick_import, require_tensorflow

__version__ = "0.1.0"

if TYPE_CHECKING:
    from keras_pendulum.config import Config
    from keras_pendulum.errors import ConfigError, UserError, WeightsError
    from keras_pendulum.evaluation import Score, evaluate_policy
    from keras_pendulum.network import DQN
    from keras_pendulum.optimum import optimal_return
    from keras_pendulum.presets import preset
    from keras_pendulum.training import TrainingResult, train_dqn
    from keras_pendulum.weights import find_weights, load_weights, save_weights

__all__ = [
    "DQN",
    "Config",
    "ConfigError",
    "Score",
    "TrainingResult",
    "UserError",
    "WeightsError",
    "evaluate_policy",
    "find_weights",
    "load_weights",
    "optimal_return",
    "preset",
    "save_weights",
    "train_dqn",
]

_HOMES = {
    "errors": ("ConfigError", "UserError", "WeightsError"),
    "evaluation": ("Score", "evaluate_policy"),
    "network": ("DQN",),
    "optimum": ("optimal_return",),
    "config": ("Config",),
    "presets": ("preset",),
    "training": ("TrainingResult", "train_dqn"),
    "weights": ("find_weights", "load_weights", "save_weights"),
}


prepare_environment()


def __getattr__(name: str) -> Any:
    for home, names in _HOMES.items():
        if name in names:
            require_tensorflow()
            with quick_import():
                return getattr(importlib.import_module(f"keras_pendulum.{home}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
