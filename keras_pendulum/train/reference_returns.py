"""The returns that pictures of a run compare with, and the title of these pictures."""

from __future__ import annotations

import math

from keras_pendulum.config.config import Config
from keras_pendulum.environments.tasks import task_name
from keras_pendulum.evaluate.evaluation import optimal_training_return, random_return
from keras_pendulum.evaluate.score import Score
from keras_pendulum.optimum.discounted import discounted_return
from keras_pendulum.optimum.optimal_return import USUAL_SEEDS
from keras_pendulum.train.learning_curve import OPTIMUM, RANDOM
from keras_pendulum.version import __version__

_VISIBLE = 0.05  # of a return; smaller differences are within the accuracy of both


def reference_returns(config: Config) -> dict[str, float]:
    """Returns the mean returns of a training episode by name; none for a pendulum beyond 200 steps.

    The names are `best possible` and `random actions`. A pendulum has one more, the return of
    the optimal policy for the discount, where it differs from the best possible.
    """
    optimum = optimal_training_return(config)
    if math.isnan(optimum):
        return {}
    random = random_return(config.environment, config.gravity, config.max_episode_steps)
    return {OPTIMUM: optimum, **_discounted(config, optimum), RANDOM: random}


def _discounted(config: Config, optimum: float) -> dict[str, float]:
    if config.gravity is None:
        return {}
    task = (config.gravity, config.discount, USUAL_SEEDS, config.max_episode_steps)
    mean = float(discounted_return(*task).mean())
    name = f"optimal policy for γ = {config.discount:g}"
    return {name: mean} if optimum - mean > _VISIBLE else {}


def run_title(config: Config, score: Score | None = None) -> str:
    """Returns two lines: preset, seed and regret; task and version."""
    name = f"{config.preset or 'own settings'}, seed {config.seed}"
    facts = [task_name(config.environment, config.gravity), f"keras_pendulum {__version__}"]
    if score is not None:
        name += f": regret {score.regret:.2f}"
        facts.insert(1, f"greedy policy on {len(score.returns)} fixed starts")
    return f"{name}\n{' · '.join(facts)}"
