"""The result of one run of a study, as the bytes of a file: the same wherever it was made."""

from __future__ import annotations

import hashlib
import json
from importlib.metadata import PackageNotFoundError, version
from typing import Any, NamedTuple

from keras_pendulum import __version__
from keras_pendulum.config import Config

EPISODES_A_POINT = 10  # of a learning curve
_ENOUGH_DIGITS = 6  # of a curve's points, after the decimal point


class Job(NamedTuple):
    """A run that is to be made: what a worker is sent."""

    arm: str
    slug: str
    config: Config  # with the run's seed
    versions: dict[str, str]


class Result(NamedTuple):
    """What is kept of a run. Nothing in it tells when, where or how fast it was made."""

    best_mean_return: float  # on the starts of seeds 0 to 99
    returns: list[float]  # greedy, from each of these starts
    average_rewards: list[float]  # while learning: mean over 10 episodes, a step
    episode_returns: list[float]  # the same, a whole episode

    @property
    def regret(self) -> float:
        """Best possible mean return minus the achieved one."""
        return self.best_mean_return - sum(self.returns) / len(self.returns)


def installed_versions() -> dict[str, str]:
    """What a result may depend on, found without importing it."""
    found = {"keras_pendulum": __version__}
    for name in ("tensorflow", "keras", "gymnasium", "numpy"):
        for package in (name, f"{name}-cpu"):
            try:
                found[name] = version(package)
                break
            except PackageNotFoundError:
                found[name] = "missing"
    return found


def thinned(values: list[float]) -> list[float]:
    """The mean of each 10 values; the last one of what is left."""
    parts = [values[i : i + EPISODES_A_POINT] for i in range(0, len(values), EPISODES_A_POINT)]
    return [round(sum(part) / len(part), _ENOUGH_DIGITS) for part in parts]


def encode(job: Job, result: Result) -> bytes:
    """A small JSON file with its own digest; equal results are equal byte for byte."""
    content = {**_head(job), "regret": result.regret, **result._asdict()}
    return _sealed(content)


def decode(data: bytes, job: Job) -> Result | None:
    """What `encode` wrote for this job; None for damaged bytes and for those of another job."""
    try:
        content = json.loads(data)["result"]
        head = _head(job)
        if _sealed(content) != data or {key: content[key] for key in head} != head:
            return None
        return Result(*(content[field] for field in Result._fields))
    except (ValueError, KeyError, TypeError, RecursionError):
        return None


def _head(job: Job) -> dict[str, Any]:
    settings = dict(vars(job.config))  # `asdict` copies deeply, which takes ten times as long
    settings["hidden_units"] = list(settings["hidden_units"])  # as JSON gives it back
    return {
        "arm": job.arm,
        "seed": settings.pop("seed"),
        "config": settings,
        "versions": job.versions,
        "episodes_a_point": EPISODES_A_POINT,
    }


def _sealed(content: dict[str, Any]) -> bytes:
    text = json.dumps(content, sort_keys=True, ensure_ascii=False)
    digest = hashlib.sha256(text.encode()).hexdigest()
    return f'{{"result": {text},\n"sha256": "{digest}"}}\n'.encode()
