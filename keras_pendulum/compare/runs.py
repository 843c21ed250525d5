"""The runs to compare: each one's settings, history and greedy score, read from its folder."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path

from keras_pendulum.compare.folders import short_names
from keras_pendulum.config.config import Config
from keras_pendulum.config.fields import format_value
from keras_pendulum.config.presets import PRESETS
from keras_pendulum.environments.tasks import TASKS, task_name
from keras_pendulum.errors import UserError
from keras_pendulum.evaluate.evaluation import evaluate_policy, optimal_training_return
from keras_pendulum.evaluate.score import Score
from keras_pendulum.history import EpisodeRecord
from keras_pendulum.storage.weights import load_weights
from keras_pendulum.train.checkpoint import load_history


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
        preset = PRESETS.get(self.config.preset, Config())
        changes = {
            spec.name: getattr(self.config, spec.name)
            for spec in fields(Config)
            if getattr(self.config, spec.name) != getattr(preset, spec.name)
        }
        # These have a column of their own, or change nothing.
        for name in (
            *("preset", "seed", "episodes"),
            *("save_every", "evaluate_every", "keep_best", "snapshots"),
        ):
            changes.pop(name, None)
        return " ".join(f"{name}={format_value(value)}" for name, value in changes.items())


def load_runs(folders: Sequence[str], checkpoints: Sequence[Path]) -> list[ComparedRun]:
    """Returns the runs in these checkpoints, in the same order, with their policies evaluated.

    Args:
        folders: the folders as the user typed them.
        checkpoints: the checkpoint in each.

    Raises UserError for a run of another task than the first one's, and for a damaged one.
    """
    runs = [load_history(file) for file in checkpoints]
    _require_one_task(folders, [config for config, _ in runs])
    for folder, (_, history) in zip(folders, runs, strict=True):
        if not history:
            raise UserError(f"{folder}: its run has no finished episode yet")
        if not all(
            math.isfinite(record.average_reward + record.episode_return) for record in history
        ):
            raise UserError(f"{folder}: its history is damaged, a return is not finite")
    scores = [evaluate_policy(load_weights(file)) for file in checkpoints]
    return [
        ComparedRun(name, *run, score)
        for name, run, score in zip(short_names(folders), runs, scores, strict=True)
    ]


def _require_one_task(folders: Sequence[str], configs: Sequence[Config]) -> None:
    tasks = [task_name(config.environment, config.gravity) for config in configs]
    others = [
        f"{folder} ({task})"
        for folder, task in zip(folders, tasks, strict=True)
        if task != tasks[0]
    ]
    if others:
        raise UserError(
            f"{', '.join(others)}: another task than that of {folders[0]} ({tasks[0]}); regrets of "
            "different tasks cannot be compared"
        )


def best_possible(runs: Sequence[ComparedRun]) -> float | None:
    """Returns the optimum of a training episode, on the scale of the learning curves.

    For the pendulum it is the average reward per step, for CartPole the return. It is None where
    the runs have episodes of different lengths, or longer ones than Gymnasium's.
    """
    if len({run.config.max_episode_steps for run in runs}) > 1:
        return None
    config = runs[0].config
    optimum = optimal_training_return(config)
    if TASKS[config.environment].never_terminates:
        optimum /= config.max_episode_steps
    return None if math.isnan(optimum) else optimum
