"""Greedy evaluations during a run."""

from __future__ import annotations

import math

from keras_pendulum.evaluate.evaluation import evaluate_policy
from keras_pendulum.train.run import Run

# Validation starts, disjoint from the reported ones. They are among the starts whose optimum every
# gravity has (`solution.USUAL_SEEDS`).
SEEDS = range(900, 950)


def greedy_regret(run: Run, episode: int) -> float:
    """Returns the greedy regret after an episode; NaN where no evaluation is due.

    Evaluations are due after `evaluate_every` episodes, twice as many, and so on. The evaluation
    has an environment of its own and draws no random number of the run.
    """
    every = run.config.evaluate_every
    if not every or (episode + 1) % every:
        return math.nan
    run.announce("evaluating")
    return evaluate_policy(run.agent.online, len(SEEDS), SEEDS.start).regret
