"""One run of a study, as a worker makes it."""

from __future__ import annotations

import os
import platform
import time
from typing import NamedTuple

from keras_pendulum.backend import keep_to_one_thread, quick_import
from keras_pendulum.environment import TASKS
from keras_pendulum.errors import UserError
from keras_pendulum.study_result import Job, Result, encode, installed_versions, thinned

_EVALUATION_EPISODES = 100


class Outcome(NamedTuple):
    """A result's bytes, and what making them cost: the seconds are no part of the result."""

    result: bytes
    training: float  # seconds
    evaluation: float  # seconds
    total: float  # seconds, with the import of TensorFlow in a worker's first run
    worker: str  # host and process


def train_and_score(job: Job) -> Outcome:
    """Trains, evaluates on the starts of seeds 0 to 99, and gives back the bytes to keep.

    Raises UserError when this worker's versions are not the study's, or learning has diverged.
    """
    begun = time.perf_counter()
    require_versions(job.versions, installed_versions(), f"the worker {_name()}")
    keep_to_one_thread()
    with quick_import():
        from keras_pendulum.evaluation import evaluate_policy
        from keras_pendulum.training import train_dqn
    started = time.perf_counter()
    trained = train_dqn(job.config)
    middle = time.perf_counter()
    score = evaluate_policy(trained.network, _EVALUATION_EPISODES)
    ended = time.perf_counter()
    known = TASKS[score.environment]
    result = Result(
        best_mean_return=score.optimal_mean_return
        if known.has_torque
        else float(known.steps_per_episode),
        returns=score.returns.tolist(),
        average_rewards=thinned([record.average_reward for record in trained.history]),
        episode_returns=thinned([record.episode_return for record in trained.history]),
    )
    data = encode(job, result)
    total = time.perf_counter() - begun
    return Outcome(data, middle - started, ended - middle, total, _name())


def require_versions(wanted: dict[str, str], found: dict[str, str], who: str) -> None:
    """Raises UserError, naming the first package that differs: results would not be comparable."""
    for package, version in wanted.items():
        if found.get(package) != version:
            raise UserError(
                f"{who} has {package} {found.get(package, 'missing')}, this study {version}: "
                "use the same versions everywhere"
            )


def _name() -> str:
    return f"{platform.node()}:{os.getpid()}"
