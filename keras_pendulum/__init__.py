"""A DQN for the inverted pendulum: a student's original and the same design without its defects.

The names below are the public API. The first use of one imports what it needs.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from keras_pendulum.tensorflow_setup import fast_import, set_environment_defaults
from keras_pendulum.version import __version__

if TYPE_CHECKING:
    from keras_pendulum.config.config import Config
    from keras_pendulum.config.presets import preset
    from keras_pendulum.diagnosis.diagnose import diagnose
    from keras_pendulum.diagnosis.diagnosis import Diagnosis
    from keras_pendulum.diagnosis.recorder import Recorder
    from keras_pendulum.dqn.network import DQN
    from keras_pendulum.errors import ConfigError, UserError, WeightsError
    from keras_pendulum.evaluate.evaluation import evaluate_policy
    from keras_pendulum.evaluate.policy import Policy
    from keras_pendulum.evaluate.q_policies import q_function
    from keras_pendulum.evaluate.score import Score
    from keras_pendulum.evaluate.sources import load_policy
    from keras_pendulum.optimum.solutions import optimal_return
    from keras_pendulum.storage.find_weights import find_weights
    from keras_pendulum.storage.load_weights import load_weights
    from keras_pendulum.storage.save_weights import save_weights
    from keras_pendulum.train.result import TrainingResult
    from keras_pendulum.train.train_dqn import train_dqn

__all__ = [
    "DQN",
    "Config",
    "ConfigError",
    "Diagnosis",
    "Policy",
    "Recorder",
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

# The module of each name, without `keras_pendulum.`.
_MODULES = {
    "Config": "config.config",
    "ConfigError": "errors",
    "DQN": "dqn.network",
    "Diagnosis": "diagnosis.diagnosis",
    "Policy": "evaluate.policy",
    "Recorder": "diagnosis.recorder",
    "Score": "evaluate.score",
    "TrainingResult": "train.train_dqn",
    "UserError": "errors",
    "WeightsError": "errors",
    "diagnose": "diagnosis.diagnose",
    "evaluate_policy": "evaluate.evaluation",
    "find_weights": "storage.find_weights",
    "load_policy": "evaluate.sources",
    "load_weights": "storage.load_weights",
    "optimal_return": "optimum.solutions",
    "preset": "config.presets",
    "q_function": "evaluate.q_policies",
    "save_weights": "storage.save_weights",
    "train_dqn": "train.train_dqn",
}

set_environment_defaults()


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    with fast_import():
        module = importlib.import_module(f"keras_pendulum.{_MODULES[name]}")
    value = globals()[name] = getattr(module, name)
    return value


def __dir__() -> list[str]:
    return __all__
