"""One run of a study, and its result as the bytes of a file: the same on every machine."""

from __future__ import annotations

import hashlib
import json
import math
import os
import platform
import time
from collections.abc import Mapping
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, version
from typing import Any, NamedTuple

from keras_pendulum.config.config import Config
from keras_pendulum.environments.tasks import TASKS
from keras_pendulum.errors import UserError
from keras_pendulum.optimum.return_cache import LOWEST_REWARD
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
    # Of the greedy policy after `evaluate_every` episodes, twice as many, … Empty in the results of
    # older versions, which are valid without them.
    greedy_regrets: list[float] = []  # noqa: RUF012

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
    clock = _EvaluationClock()
    training = train_dqn(
        replace(job.config, evaluate_every=evaluate_every(job.config)),
        listeners=[clock.end],
        on_phase=clock.begin,
    )
    trained = time.perf_counter()
    score = evaluate_policy(training.network, EVALUATION_EPISODES)
    evaluated = time.perf_counter()
    result = RunResult(
        optimal_mean_return=score.optimal_mean_return,
        returns=score.returns.tolist(),
        average_rewards=curve_points([record.average_reward for record in training.history]),
        episode_returns=curve_points([record.episode_return for record in training.history]),
        greedy_regrets=[
            round(record.greedy_regret, _DECIMALS)
            for record in training.history
            if not math.isnan(record.greedy_regret)
        ],
    )
    data = encode(job, result)
    total = time.perf_counter() - started
    training_seconds = trained - imported - clock.seconds
    evaluation_seconds = evaluated - trained + clock.seconds
    return Reply(data, training_seconds, evaluation_seconds, total, worker)


def evaluate_every(config: Config) -> int:
    """Returns the number of episodes between two greedy evaluations of a study's run."""
    return math.ceil(config.episodes / _EVALUATIONS)


class _EvaluationClock:
    """Hooks of `train_dqn` that sum the seconds of the evaluations during a run."""

    def __init__(self) -> None:
        self.seconds = 0.0
        self._began: float | None = None

    def begin(self, phase: str) -> None:
        if phase == "evaluating":
            self._began = time.perf_counter()

    def end(self, record: object) -> None:
        if self._began is not None:
            self.seconds += time.perf_counter() - self._began
            self._began = None


def curve_points(values: list[float]) -> list[float]:
    """Returns the mean of every 10 values; the last mean may have fewer."""
    starts = range(0, len(values), EPISODES_PER_POINT)
    blocks = [values[start : start + EPISODES_PER_POINT] for start in starts]
    return [round(sum(block) / len(block), _DECIMALS) for block in blocks]


def installed_versions() -> dict[str, str]:
    """Returns the versions of the packages that a result depends on, without importing them."""
    versions = {"keras_pendulum": __version__}
    for name in ("tensorflow", "keras", "gymnasium", "numpy"):
        for package in (name, f"{name}-cpu"):
            try:
                versions[name] = version(package)
                break
            except PackageNotFoundError:
                versions[name] = "missing"
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
    return _with_checksum({**_settings(job), "regret": result.regret, **result._asdict()})


def decode(data: bytes, job: Job) -> RunResult | None:
    """Returns the result that `encode` wrote for this job.

    Returns None for damaged or other bytes, and for numbers that no run can have.
    """
    try:
        content = json.loads(data)["result"]
        settings = _settings(job)
        if _with_checksum(content) != data:
            return None
        if {key: content[key] for key in settings} != settings:
            return None
        fields = {"greedy_regrets": [], **content}  # results of older versions have none
        result = RunResult(*(fields[field] for field in RunResult._fields))
        valid = _is_possible(result, job.config) and content["regret"] == result.regret
        return result if valid else None
    except (ValueError, KeyError, TypeError, RecursionError):
        return None


def _is_possible(result: RunResult, config: Config) -> bool:
    """Returns whether a run can have these numbers: how many there are, and their ranges."""
    task = TASKS[config.environment]
    low, high = (LOWEST_REWARD, 0.0) if task.has_torque else (0.0, 1.0)  # of a step's reward
    points = math.ceil(config.episodes / EPISODES_PER_POINT)
    evaluations = config.episodes // evaluate_every(config)
    largest_regret = task.steps_per_episode * (high - low)

    def are_between(numbers: list[float], low: float, high: float) -> bool:
        return all(isinstance(number, float) and low <= number <= high for number in numbers)

    def are_possible(numbers: list[float], count: int, steps: int) -> bool:
        return len(numbers) == count and are_between(numbers, steps * low, steps * high)

    return (
        are_possible([result.optimal_mean_return], 1, task.steps_per_episode)
        and are_possible(result.returns, EVALUATION_EPISODES, task.steps_per_episode)
        and are_possible(result.average_rewards, points, 1)
        and are_possible(result.episode_returns, points, config.max_episode_steps)
        and len(result.greedy_regrets) in (0, evaluations)
        and are_between(result.greedy_regrets, -largest_regret, largest_regret)
    )


def _settings(job: Job) -> dict[str, Any]:
    """Returns everything that identifies the job, as JSON reads it back."""
    config = config_as_json(job.config)
    return {
        "arm": job.arm,
        "seed": config.pop("seed"),
        "config": config,
        "versions": job.versions,
        "episodes_per_point": EPISODES_PER_POINT,
    }


def config_as_json(config: Config) -> dict[str, Any]:
    """Returns the settings that a run of a study can have, as JSON reads them back."""
    settings = dict(vars(config))  # `asdict` copies deeply, which takes ten times as long
    settings["hidden_units"] = list(config.hidden_units)
    for name in ("evaluate_every", "keep_best", "snapshots"):  # no arm sets them, see `own_arms`
        del settings[name]
    return settings


def _with_checksum(content: dict[str, Any]) -> bytes:
    text = json.dumps(content, sort_keys=True, ensure_ascii=False)
    checksum = hashlib.sha256(text.encode()).hexdigest()
    return f'{{"result": {text},\n"sha256": "{checksum}"}}\n'.encode()
