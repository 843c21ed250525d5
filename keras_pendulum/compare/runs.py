"""The runs to compare: each one's settings, history and greedy score, read from its folder."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import count
from pathlib import Path

from keras_pendulum.config.config import Config
from keras_pendulum.config.fields import format_value
from keras_pendulum.config.presets import PRESETS
from keras_pendulum.errors import UserError
from keras_pendulum.evaluate.evaluation import evaluate_policy
from keras_pendulum.evaluate.score import Score
from keras_pendulum.history import EpisodeRecord
from keras_pendulum.optimum.solutions import solution
from keras_pendulum.storage.load_weights import load_weights
from keras_pendulum.storage.recorded_run import load_recorded_run
from keras_pendulum.storage.run_folder import RunFolder


@dataclass(frozen=True)
class ComparedRun:
    """A run with at least one episode."""

    name: str
    config: Config
    history: list[EpisodeRecord]
    score: Score  # of the greedy policy in the last checkpoint

    @property
    def changed_settings(self) -> str:
        """The settings that differ from the preset's, such as `discount=0.95 tau=0.01`."""
        preset = PRESETS.get(self.config.preset, Config()).learning()
        own_columns = ("preset", "seed", "episodes")
        return " ".join(
            f"{name}={format_value(value)}"
            for name, value in self.config.learning().items()
            if value != preset[name] and name not in own_columns
        )


def load_runs(folders: Sequence[RunFolder]) -> list[ComparedRun]:
    """Returns the runs in these folders, in the same order, with their policies evaluated.

    Raises UserError for a run of another task than the first one's, and for a damaged one.
    """
    runs = [load_recorded_run(folder.weights) for folder in folders]
    tasks = [run.config.task.name for run in runs]
    others = [
        f"{folder.path} ({task})"
        for folder, task in zip(folders, tasks, strict=True)
        if task != tasks[0]
    ]
    if others:
        raise UserError(
            f"{', '.join(others)}: another task than that of {folders[0].path} ({tasks[0]}); "
            "regrets of different tasks cannot be compared"
        )
    for folder, run in zip(folders, runs, strict=True):
        if not run.history:
            raise UserError(f"{folder.path}: its run has no finished episode yet")
    scores = [evaluate_policy(load_weights(folder.weights)) for folder in folders]
    names = short_names([folder.path for folder in folders])
    return [
        ComparedRun(name, run.config, run.history, score)
        for name, run, score in zip(names, runs, scores, strict=True)
    ]


def short_names(folders: Sequence[str | os.PathLike[str]]) -> list[str]:
    """Returns the names of different folders, with as many parents as make the names different."""
    paths = [Path(os.path.realpath(folder)).parts for folder in folders]
    names = (["/".join(parts[-length:]) for parts in paths] for length in count(1))
    return next(each for each in names if len(set(each)) == len(paths))


def best_possible(runs: Sequence[ComparedRun]) -> float | None:
    """Returns the optimum of a training episode, on the scale of the learning curves.

    It is None where the runs have episodes of different lengths, or longer ones than Gymnasium's.
    """
    if len({run.config.max_episode_steps for run in runs}) > 1:
        return None
    config = runs[0].config
    steps = config.max_episode_steps
    optimum = solution(config.task).mean_best_return(steps)
    return None if math.isnan(optimum) else config.task.curve_value(optimum, steps)
