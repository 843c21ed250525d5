"""The returns that pictures of a run compare with, and the title of these pictures."""

from __future__ import annotations

import math

from keras_pendulum.config.config import Config
from keras_pendulum.evaluate.score import Score
from keras_pendulum.figures.learning_curve import OPTIMUM, RANDOM
from keras_pendulum.optimum.solution import USUAL_SEEDS
from keras_pendulum.optimum.solutions import solution
from keras_pendulum.version import __version__

_VISIBLE = 0.05  # of a return; smaller differences are within the accuracy of both


def reference_returns(config: Config) -> dict[str, float]:
    """Returns the mean returns of a training episode by name; none for a pendulum beyond 200 steps.

    The names are `best possible` and `random actions`. A pendulum has one more, the return of
    the optimal policy for the discount, where it differs from the best possible.
    """
    exact, steps = solution(config.task), config.max_episode_steps
    optimum = exact.mean_best_return(steps)
    if math.isnan(optimum):
        return {}
    levels = {OPTIMUM: optimum}
    discounted = exact.discounted_returns(config.discount, USUAL_SEEDS, steps)
    if discounted is not None and optimum - discounted.mean() > _VISIBLE:
        levels[f"optimal policy for γ = {config.discount:g}"] = float(discounted.mean())
    return {**levels, RANDOM: exact.random_return(steps)}


def run_title(config: Config, score: Score | None = None) -> str:
    """Returns two lines: preset, seed and regret; task and version."""
    name = f"{config.preset or 'own settings'}, seed {config.seed}"
    facts = [config.task.name, f"keras_pendulum {__version__}"]
    if score is not None:
        name += f": regret {score.regret:.2f}"
        facts.insert(1, f"greedy policy on {len(score.returns)} fixed starts")
    return f"{name}\n{' · '.join(facts)}"
