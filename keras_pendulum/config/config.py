"""The settings of a run, and which of them exclude each other."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from itertools import pairwise
from typing import Any

from keras_pendulum.config.fields import Integer, Only, Switch, kind_of, setting
from keras_pendulum.config.learning import Learning
from keras_pendulum.environments.task import Task
from keras_pendulum.environments.tasks import make_task
from keras_pendulum.errors import ConfigError
from keras_pendulum.limits import LARGEST_FILE


@dataclass(frozen=True)
class Recording:
    """The settings of what is written during a run. They do not change what it learns."""

    save_every: int = setting(10, "episodes between two checkpoints", Integer(1, 1_000_000))
    evaluate_every: int = setting(
        0,
        "episodes between two greedy evaluations during the run, 0 for none; each plays the 50 "
        "starts of seeds 900 to 949, on which no result is reported, takes about 0.3 s (with 50, a "
        "fifth of the training time of reference), and does not change the training",
        Integer(0, 1_000_000),
    )
    keep_best: bool = setting(
        False,
        "true: save the weights of the best evaluation as ..._best.h5, beside the last weights",
        Switch(),
        only=("evaluate_every",),
    )
    snapshots: int = setting(
        0,
        "networks of the run to keep for the page, evenly spaced from the initial to the final "
        "one, as ..._snapshots.h5; 0 for none",
        Integer(0, 100),
    )


@dataclass(frozen=True)
class Config(Recording, Learning):  # in this order, the fields of Learning come first
    """The settings of one run. The defaults are the preset `reference`.

    Raises ConfigError, naming the setting, for a value outside its range, and for a value of a
    setting that has no effect with the others.

    >>> config = kp.preset("reference", seed=3, hidden_units=(64, 64))
    >>> config.hidden_units, config.total_updates
    ((64, 64), 18360)
    """

    def __post_init__(self) -> None:
        for spec in fields(self):
            value = kind_of(spec).validate(spec.name, getattr(self, spec.name))
            object.__setattr__(self, spec.name, value)
            only: Only | None = spec.metadata["only"]
            if only:  # the setting that it names is declared, and so validated, before
                only.check(spec.name, value, vars(self))
        self._check_updates()
        self._check_recording()
        self._check_size()

    def change(self, **changes: Any) -> Config:
        """Returns these settings with some changed.

        A setting that loses its effect gets its default, or None: without a pendulum, the gravity
        is None. (`dataclasses.replace` raises ConfigError there.)

        Raises ConfigError as the class does, also for a change that has no effect.

        >>> kp.preset("cartpole-original").change(target_update="hard").tau
        0.1
        """
        return Config(**{**used({**vars(self), **changes}), **changes})

    def learning(self) -> dict[str, Any]:
        """Returns the settings that decide what the run learns: all but those of Recording."""
        return {spec.name: getattr(self, spec.name) for spec in fields(Learning)}

    @property
    def task(self) -> Task:
        """The environment with its physics."""
        return make_task(self.environment, vars(self))

    @property
    def total_updates(self) -> int:
        """Number of updates of the whole run with `train_frequency` episode."""
        return max(0, self.episodes - self.warmup_episodes) * self.updates_per_episode

    @property
    def averaged_updates(self) -> int:
        """Number of updates over which the final weights are averaged.

        The moving average begins with the initial weights. After all planned updates their share is
        at most e^-10. A run may make fewer: `Agent.average_weights` takes no average in which the
        share is above 1e-3.
        """
        return max(1, min(self.average_updates, self.total_updates // 10))

    def _check_updates(self) -> None:
        """Raises ConfigError where the updates lack a torque, a learning rate or transitions."""
        if self.stored_index == "truncated" and self.torque_count != 41:
            raise ConfigError(
                "stored_index truncated belongs to the walkthrough's 41 torques, not to "
                f"torque_count {self.torque_count}"
            )
        if self.train_frequency == "step" and self.learning_rate_schedule == "cosine":
            raise ConfigError(
                "learning_rate_schedule cosine needs train_frequency episode: with step the number "
                "of updates is not known before the run"
            )
        if self.learning_rate_min > self.learning_rate:
            raise ConfigError(
                f"learning_rate_min {self.learning_rate_min} is larger than learning_rate "
                f"{self.learning_rate}: make it smaller"
            )
        stored = self.replay_capacity
        if self.task.never_terminates and self.train_frequency == "episode":
            stored = min(stored, (self.warmup_episodes + 1) * self.max_episode_steps)
        if self.batch_size > stored:
            raise ConfigError(
                f"batch_size {self.batch_size} is larger than the {stored} transitions that "
                "replay_capacity, warmup_episodes and max_episode_steps leave for the first batch"
            )

    def _check_recording(self) -> None:
        """Raises ConfigError where the run has no evaluation, or fewer networks than it keeps."""
        if self.evaluate_every > self.episodes:
            raise ConfigError(
                f"evaluate_every {self.evaluate_every} is larger than the run's {self.episodes} "
                "episodes: make it smaller, or 0 for no evaluation"
            )
        if self.snapshots == 1:
            raise ConfigError("snapshots is 1; expected 0 for none, or 2 to 100")
        if self.snapshots > self.episodes + 1:
            raise ConfigError(
                f"snapshots {self.snapshots} is larger than the run's {self.episodes} episodes "
                "plus 1: make it smaller, or 0 for none"
            )

    def _check_size(self) -> None:
        """Raises ConfigError for a run with a file that would be too large to load."""
        inputs, outputs = self.task.observation_size, self.task.action_count(self.torque_count)
        widths = (inputs, *self.hidden_units, outputs)
        weights = sum((before + 1) * after for before, after in pairwise(widths))
        copies = 4 if self.optimizer == "adam" else 5  # online, target, and the optimizer's moments
        copies += self.average_updates > 1
        transition = 8 * inputs + 9  # bytes
        size = 4 * copies * weights + self.replay_capacity * transition + 64 * self.episodes
        size += 16 * (self.episodes // self.evaluate_every) if self.evaluate_every else 0
        sizes = {"hidden_units and replay_capacity make a checkpoint": size}
        if self.snapshots:  # one network in float32, the others in float16
            sizes["snapshots and hidden_units make a file"] = (4 + 2 * self.snapshots) * weights
        for what, size in sizes.items():
            if size > LARGEST_FILE - 2**20:
                raise ConfigError(
                    f"{what} of {size / 2**30:.1f} GiB; the limit is 1 GiB: make them smaller"
                )


def used(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Returns the settings, each without an effect at its default or None."""
    conditions: dict[str, Only | None] = {
        spec.name: spec.metadata["only"] for spec in fields(Config)
    }
    unused = {
        name: only.unused for name, only in conditions.items() if only and not only.holds(settings)
    }
    return {**settings, **unused}
