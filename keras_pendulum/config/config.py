"""The settings of a run: the only place where defaults are defined."""

from __future__ import annotations

from dataclasses import dataclass, fields
from itertools import pairwise

from keras_pendulum.config.fields import (
    Integer,
    Integers,
    Number,
    Switch,
    Text,
    kind_of,
    setting,
)
from keras_pendulum.environments.tasks import TASKS
from keras_pendulum.errors import ConfigError

LARGEST_FILE = 2**30  # bytes of a `.h5` file; a checkpoint of `reference` has 4.5 MB


@dataclass(frozen=True)
class Config:
    """The settings of one run. The defaults are the preset `reference`.

    Raises ConfigError, naming the setting, for a value outside its range.
    """

    preset: str = setting("reference", "name of the preset that these settings come from", Text())
    environment: str = setting("Pendulum-v1", "Gymnasium's environment", Text(tuple(TASKS)))
    gravity: float | None = setting(
        1.0,
        "gravity of the pendulum in m/s² (Gymnasium's own default is 10); none for CartPole",
        Number(0, 100, optional=True),
    )
    episodes: int = setting(500, "episodes of the run", Integer(1, 1_000_000))
    max_episode_steps: int = setting(
        100,
        "steps after which a training episode is truncated; an evaluation uses Gymnasium's limit",
        Integer(1, 10_000),
    )
    seed: int = setting(0, "seed of every random draw of the run", Integer(0, 2**32 - 1))
    hidden_units: tuple[int, ...] = setting(
        (512, 256, 128), "widths of the hidden layers, comma-separated", Integers(1, 8192)
    )
    activation: str = setting("tanh", "activation of the hidden layers", Text(("tanh", "relu")))
    initial_weights: str = setting(
        "glorot",
        "glorot: uniform, by inputs and outputs, biases 0 (Keras's default); fan-in: uniform "
        "within ±1/√inputs, biases too (PyTorch's default); spread: glorot, but fan-in kernel in "
        "the first layer and hidden biases within ±0.3, so that the units differ more",
        Text(("glorot", "fan-in", "spread")),
    )
    torque_count: int = setting(
        41, "torques of the pendulum, linspace(-2, 2, torque_count) N·m", Integer(2, 1001)
    )
    replay_capacity: int = setting(
        14_000, "transitions in the replay buffer", Integer(1, 10_000_000)
    )
    batch_size: int = setting(
        32, "transitions of one update, drawn without replacement", Integer(1, 65_536)
    )
    discount: float = setting(0.9, "discount factor γ per step", Number(0, 1))
    reward_scale: float = setting(
        1.0, "factor on the rewards in the replay buffer", Number(1e-6, 1e6)
    )
    double_q: bool = setting(
        False,
        "true: the online network chooses the next action, the target network values it (van "
        "Hasselt et al. 2016); false: the target network's highest value",
        Switch(),
    )
    loss: str = setting(
        "squared",
        "squared: mean squared error over all outputs; huber: Huber loss of the taken actions, δ = "
        "1",
        Text(("squared", "huber")),
    )
    epsilon_schedule: str = setting(
        "episodes",
        "episodes: ε is multiplied by epsilon_decay before each episode; steps: ε falls "
        "exponentially with the environment steps",
        Text(("episodes", "steps")),
    )
    epsilon_start: float = setting(0.9, "ε before the first decay", Number(0, 1))
    epsilon_decay: float = setting(
        0.99, "factor on ε before each episode (epsilon_schedule episodes)", Number(0, 1)
    )
    epsilon_decay_steps: float = setting(
        1000.0,
        "steps in which ε - epsilon_min falls to 1/e (epsilon_schedule steps)",
        Number(1, 1e9),
    )
    epsilon_min: float = setting(0.01, "lowest ε", Number(0, 1))
    train_frequency: str = setting(
        "episode",
        "episode: updates_per_episode updates after each episode; step: one update after each step",
        Text(("episode", "step")),
    )
    warmup_episodes: int = setting(
        41, "episodes before the first update (train_frequency episode)", Integer(0, 1_000_000)
    )
    updates_per_episode: int = setting(
        40, "updates after each episode (train_frequency episode)", Integer(1, 10_000)
    )
    optimizer: str = setting(
        "adam",
        "adam (Kingma & Ba 2015); adamw: with weight decay (Loshchilov & Hutter 2019) and AMSGrad "
        "(Reddi et al. 2018)",
        Text(("adam", "adamw")),
    )
    optimizer_epsilon: float = setting(
        1e-7, "Adam's ε (Keras's default: 1e-7; PyTorch's: 1e-8)", Number(0, 1)
    )
    weight_decay: float = setting(
        0.0, "weight decay per update, times the learning rate (optimizer adamw)", Number(0, 1)
    )
    gradient_clip: float | None = setting(
        None, "limit on the size of each gradient value, or none", Number(1e-9, 1e9, optional=True)
    )
    learning_rate: float = setting(1e-3, "initial learning rate", Number(1e-9, 10))
    learning_rate_schedule: str = setting(
        "cosine",
        "constant; cosine: falls to learning_rate_min at the last update",
        Text(("constant", "cosine")),
    )
    learning_rate_min: float = setting(
        0.0, "learning rate of the last update (learning_rate_schedule cosine)", Number(0, 10)
    )
    average_updates: int = setting(
        1,
        "updates over which the final weights are averaged: a moving average, use_ema of Keras "
        "(Polyak & Juditsky 1992); 1: the weights of the last update",
        Integer(1, 1_000_000),
    )
    target_update: str = setting(
        "soft",
        "soft: the target network moves by tau at each update (Lillicrap et al. 2016); hard: it is "
        "copied every target_period updates (Mnih et al. 2015); none: no target network (defect "
        "no-target-network)",
        Text(("soft", "hard", "none")),
    )
    tau: float = setting(
        0.1, "share of the online weights in each target update (target_update soft)", Number(0, 1)
    )
    target_period: int = setting(
        200, "updates from one copy to the next (target_update hard)", Integer(1, 1_000_000)
    )
    stored_index: str = setting(
        "exact",
        "action index in the replay buffer: exact; truncated: computed back from the torque "
        "(defect index-truncation)",
        Text(("exact", "truncated")),
    )
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
        "true: save the weights of the best evaluation (evaluate_every) as ..._best.h5, beside the "
        "last weights",
        Switch(),
    )
    snapshots: int = setting(
        0,
        "networks of the run to keep for the page, evenly spaced from the initial to the final "
        "one, as ..._snapshots.h5; 0 for none",
        Integer(0, 100),
    )

    def __post_init__(self) -> None:
        for spec in fields(self):
            value = kind_of(spec).validate(spec.name, getattr(self, spec.name))
            object.__setattr__(self, spec.name, value)
        self._check_task()
        self._check_evaluations()
        self._check_snapshots()
        self._check_size()
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
        if TASKS[self.environment].never_terminates and self.train_frequency == "episode":
            stored = min(stored, (self.warmup_episodes + 1) * self.max_episode_steps)
        if self.batch_size > stored:
            raise ConfigError(
                f"batch_size {self.batch_size} is larger than the {stored} transitions that "
                "replay_capacity, warmup_episodes and max_episode_steps leave for the first batch"
            )

    def _check_task(self) -> None:
        """Raises ConfigError for a setting that the environment does not have."""
        if TASKS[self.environment].has_torque:
            if self.gravity is None:
                raise ConfigError(f"gravity is missing; {self.environment} needs it")
        else:
            pendulum_only = {
                "gravity": (self.gravity, None),
                "torque_count": (self.torque_count, Config.torque_count),
                "stored_index": (self.stored_index, Config.stored_index),
            }
            for name, (value, unused) in pendulum_only.items():
                if value != unused:
                    raise ConfigError(
                        f"{name} {value} belongs to Pendulum-v1; {self.environment} has no {name}"
                    )
        if self.stored_index == "truncated" and self.torque_count != 41:
            raise ConfigError(
                "stored_index truncated belongs to the walkthrough's 41 torques, not to "
                f"torque_count {self.torque_count}"
            )

    def _check_evaluations(self) -> None:
        """Raises ConfigError where the run would have no evaluation, or no best one."""
        if self.evaluate_every > self.episodes:
            raise ConfigError(
                f"evaluate_every {self.evaluate_every} is larger than the run's {self.episodes} "
                "episodes: make it smaller, or 0 for no evaluation"
            )
        if self.keep_best and not self.evaluate_every:
            raise ConfigError(
                "keep_best needs evaluate_every: set the episodes between two evaluations, such as "
                "--evaluate-every 50"
            )

    def _check_snapshots(self) -> None:
        """Raises ConfigError where the run has fewer networks than it shall keep."""
        if self.snapshots == 1:
            raise ConfigError("snapshots is 1; expected 0 for none, or 2 to 100")
        if self.snapshots > self.episodes + 1:
            raise ConfigError(
                f"snapshots {self.snapshots} is larger than the run's {self.episodes} episodes "
                "plus 1: make it smaller, or 0 for none"
            )

    def _check_size(self) -> None:
        """Raises ConfigError for a run with a file that would be too large to load."""
        task = TASKS[self.environment]
        outputs = task.action_count or self.torque_count
        widths = (task.observation_size, *self.hidden_units, outputs)
        weights = sum((inputs + 1) * units for inputs, units in pairwise(widths))
        copies = 4 if self.optimizer == "adam" else 5  # online, target, and the optimizer's moments
        copies += self.average_updates > 1
        transition = 8 * task.observation_size + 9  # bytes
        size = 4 * copies * weights + self.replay_capacity * transition + 64 * self.episodes
        size += 16 * (self.episodes // self.evaluate_every) if self.evaluate_every else 0
        if size > LARGEST_FILE - 2**20:
            raise ConfigError(
                f"hidden_units and replay_capacity make a checkpoint of {size / 2**30:.1f} GiB; "
                "the limit is 1 GiB: make them smaller"
            )
        size = (4 + 2 * self.snapshots) * weights  # one network in float32, the others in float16
        if self.snapshots and size > LARGEST_FILE - 2**20:
            raise ConfigError(
                f"snapshots and hidden_units make a file of {size / 2**30:.1f} GiB; the limit is "
                "1 GiB: make them smaller"
            )

    @property
    def total_updates(self) -> int:
        """Number of updates of the whole run with `train_frequency` episode."""
        return max(0, self.episodes - self.warmup_episodes) * self.updates_per_episode
