"""The returns that pictures of a run compare with, and the title of these pictures."""

from __future__ import annotations

import math

from keras_pendulum.config.config import Config
from keras_pendulum.environments.tasks import task_name
from keras_pendulum.evaluate.evaluation import Score, optimal_training_return, random_return
from keras_pendulum.train.learning_curve import OPTIMUM, RANDOM
from keras_pendulum.version import __version__


def reference_returns(config: Config) -> dict[str, float]:
    """Returns the mean returns of a training episode by name; none for a pendulum beyond 200 steps.

    The names are `best possible` and `random actions`.
    """
    optimum = optimal_training_return(config)
    if math.isnan(optimum):
        return {}
    random = random_return(config.environment, config.gravity, config.max_episode_steps)
    return {OPTIMUM: optimum, RANDOM: random}


def run_title(config: Config, score: Score | None = None) -> str:
    """Returns two lines: preset, seed and regret; task and version."""
    name = f"{config.preset or 'own settings'}, seed {config.seed}"
    facts = [task_name(config.environment, config.gravity), f"keras_pendulum {__version__}"]
    if score is not None:
        name += f": regret {score.regret:.2f}"
        facts.insert(1, f"greedy policy on {len(score.returns)} fixed starts")
    return f"{name}\n{' · '.join(facts)}"
