"""One run of a study, and its result as the bytes of a file: the same on every machine."""

from __future__ import annotations

import hashlib
import json
import math
import os
import platform
import time
from collections.abc import Mapping
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from typing import Any, NamedTuple

from keras_pendulum.config.config import Config
from keras_pendulum.config.settings import read_settings
from keras_pendulum.errors import UserError
from keras_pendulum.tensorflow_setup import fast_import, use_one_thread
from keras_pendulum.version import __version__

EPISODES_PER_POINT = 10  # of a learning curve
_EVALUATIONS = 10  # of the greedy policy during a run, at most
_DECIMALS = 6  # of a learning curve
EVALUATION_EPISODES = 100


class Job(NamedTuple):
    """A run of a study, as it is sent to a worker."""

    arm: str
    slug: str  # the arm's name in file names
    config: Config  # with the run's seed
    versions: dict[str, str]  # of the study's packages

    def __str__(self) -> str:
        return f"{self.arm}, seed {self.config.seed}"


class RunResult(NamedTuple):
    """The saved numbers of a run. They do not depend on when, where or how fast it was made."""

    optimal_mean_return: float  # on the starts of seeds 0 to 99
    returns: list[float]  # greedy, from the same starts
    average_rewards: list[float]  # per step, while training; means over 10 episodes
    episode_returns: list[float]  # while training; means over 10 episodes
    # Of the greedy policy after `evaluate_every` episodes, twice as many, …
    greedy_regrets: list[float]

    @property
    def regret(self) -> float:
        """The mean optimal return minus the mean return."""
        return self.optimal_mean_return - sum(self.returns) / len(self.returns)


class Reply(NamedTuple):
    """A worker's answer: the result as bytes, and its cost, which is not part of the result."""

    result: bytes
    training: float  # seconds
    evaluation: float  # seconds
    total: float  # seconds, including the import of TensorFlow in a worker's first run
    worker: str  # host and process


def train_and_score(job: Job) -> Reply:
    """Trains, evaluates on the starts of seeds 0 to 99, and returns the result.

    Raises UserError when the training diverges, or when this worker has other versions than the
    study.
    """
    started = time.perf_counter()
    worker = f"{platform.node()}:{os.getpid()}"
    require_versions(job.versions, installed_versions(), f"the worker {worker}")
    use_one_thread()
    with fast_import():
        from keras_pendulum.evaluate.evaluation import evaluate_policy
        from keras_pendulum.train.train_dqn import train_dqn
    imported = time.perf_counter()
    training = train_dqn(job.config.change(evaluate_every=evaluate_every(job.config)))
    history = training.history
    score = evaluate_policy(training.network, EVALUATION_EPISODES)
    result = RunResult(
        optimal_mean_return=score.optimal_mean_return,
        returns=score.returns.tolist(),
        average_rewards=curve_points([record.average_reward for record in history]),
        episode_returns=curve_points([record.episode_return for record in history]),
        greedy_regrets=[
            round(record.greedy_regret, _DECIMALS)
            for record in history
            if not math.isnan(record.greedy_regret)
        ],
    )
    data = encode(job, result)
    ended = time.perf_counter()
    training_seconds = sum(record.seconds for record in history)
    evaluation_seconds = ended - imported - training_seconds  # during the run, and at its end
    return Reply(data, training_seconds, evaluation_seconds, ended - started, worker)


def evaluate_every(config: Config) -> int:
    """Returns the number of episodes between two greedy evaluations of a study's run."""
    return math.ceil(config.episodes / _EVALUATIONS)


def curve_points(values: list[float]) -> list[float]:
    """Returns the mean of every 10 values; the last mean may have fewer."""
    starts = range(0, len(values), EPISODES_PER_POINT)
    blocks = [values[start : start + EPISODES_PER_POINT] for start in starts]
    return [round(sum(block) / len(block), _DECIMALS) for block in blocks]


def installed_versions() -> dict[str, str]:
    """Returns the versions of the packages that a result depends on, without importing them."""
    versions = {"keras_pendulum": __version__}
    for package in ("tensorflow-cpu", "tensorflow", "keras", "gymnasium", "numpy"):
        with suppress(PackageNotFoundError):
            versions[package.removesuffix("-cpu")] = version(package)
    return versions


def require_versions(expected: Mapping[str, str], found: Mapping[str, str], who: str) -> None:
    """Raises UserError, naming the first package that differs: results would not be comparable."""
    for package, number in expected.items():
        if found.get(package) != number:
            raise UserError(
                f"{who} has {package} {found.get(package, 'missing')}, this study has {number}: "
                "use the same versions everywhere"
            )


def encode(job: Job, result: RunResult) -> bytes:
    """Returns a small JSON file with its SHA-256; equal results have equal bytes."""
    return _with_checksum(_content(job, result))


def decode(data: bytes, job: Job) -> RunResult | None:
    """Returns the result that `encode` wrote for this job.

    Returns None for damaged or other bytes, and for numbers that no run can have.
    """
    try:
        content = json.loads(data)["result"]
        result = RunResult(*(content[field] for field in RunResult._fields))
        # Older files also record settings that have no effect.
        config = learning_settings(read_settings(content["config"]))
        valid = (
            _with_checksum(content) == data
            and _is_possible(result, job.config)
            and {**content, "config": config} == _content(job, result)
        )
    except (ValueError, KeyError, TypeError, RecursionError):
        return None
    return result if valid else None


def _is_possible(result: RunResult, config: Config) -> bool:
    """Returns whether a run can have these numbers: how many there are, and their ranges."""
    task = config.task
    low, high = task.reward_range
    steps, training_steps = task.steps_per_episode, config.max_episode_steps
    points = math.ceil(config.episodes / EPISODES_PER_POINT)
    evaluations = config.episodes // evaluate_every(config)
    largest_regret = steps * (high - low)
    ranges = [
        ([result.optimal_mean_return], 1, steps * low, steps * high),
        (result.returns, EVALUATION_EPISODES, steps * low, steps * high),
        (result.average_rewards, points, low, high),
        (result.episode_returns, points, training_steps * low, training_steps * high),
        (result.greedy_regrets, evaluations, -largest_regret, largest_regret),
    ]
    return all(
        len(numbers) == count
        and all(isinstance(number, float) and least <= number <= most for number in numbers)
        for numbers, count, least, most in ranges
    )


def learning_settings(config: Config) -> dict[str, Any]:
    """Returns the settings that an arm can have."""
    settings = config.learning()
    del settings["seed"]
    return settings


def _content(job: Job, result: RunResult) -> dict[str, Any]:
    """Returns the result with everything that identifies the job."""
    return {
        "arm": job.arm,
        "seed": job.config.seed,
        "config": learning_settings(job.config),
        "versions": job.versions,
        "episodes_per_point": EPISODES_PER_POINT,
        "regret": result.regret,
        **result._asdict(),
    }


def _with_checksum(content: dict[str, Any]) -> bytes:
    text = json.dumps(content, sort_keys=True, ensure_ascii=False)
    checksum = hashlib.sha256(text.encode()).hexdigest()
    return f'{{"result": {text},\n"sha256": "{checksum}"}}\n'.encode()
