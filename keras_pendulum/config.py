"""Every number of a run, with its unit and source."""

from __future__ import annotations

from dataclasses import dataclass, fields
from itertools import pairwise
from typing import Any

from keras_pendulum.environment import TASKS
from keras_pendulum.errors import ConfigError
from keras_pendulum.setting import checked, setting

LARGEST_FILE = 2**30  # bytes that a `.h5` may have; a checkpoint of `reference` has 4.5 MB


@dataclass(frozen=True)
class Config:
    """The settings of one run. The defaults are the preset `reference`.

    Raises ConfigError, naming the field, for a value outside its range.
    """

    preset: str = setting("reference", "name of the preset these settings started from")
    environment: str = setting("Pendulum-v1", "Gymnasium's name", choices=tuple(TASKS))
    gravity: float | None = setting(
        1.0,
        "the pendulum's gravity in m/s² (Gymnasium's own default is 10; the original uses 1)",
        low=0,
        high=100,
    )
    episodes: int = setting(500, "episodes (original: 500)", low=1, high=1_000_000)
    episode_steps: int = setting(
        200,
        "most steps of a training episode (original: 200; CartPole: 500); evaluation makes as many "
        "as Gymnasium does",
        low=1,
        high=10_000,
    )
    seed: int = setting(0, "seed of every random draw of the run", low=0, high=2**32 - 1)
    hidden_units: tuple[int, ...] = setting(
        (512, 256, 128), "widths of the hidden layers, comma-separated (original)", low=1, high=8192
    )
    activation: str = setting(
        "tanh",
        "of the hidden layers: tanh (original), or relu (notebooks)",
        choices=("tanh", "relu"),
    )
    initial_weights: str = setting(
        "glorot",
        "glorot: uniform, by inputs and outputs, biases 0 (Keras, original), or fan-in: uniform "
        "within ±1/√inputs, biases too (PyTorch, notebooks)",
        choices=("glorot", "fan-in"),
    )
    torque_count: int = setting(
        41,
        "the pendulum's torques, evenly spaced from -2 to 2 N·m (original: linspace)",
        low=2,
        high=1001,
    )
    replay_capacity: int = setting(
        25_000, "transitions remembered (original: 8000)", low=1, high=10_000_000
    )
    batch_size: int = setting(
        32, "transitions in an update, drawn without replacement (original: 32)", low=1, high=65_536
    )
    discount: float = setting(0.9, "discount γ a step (original: 0.9)", low=0, high=1)
    reward_scale: float = setting(
        1.0, "factor on the rewards that are learned from (original: 1)", low=1e-6, high=1e6
    )
    bootstrap: str = setting(
        "max",
        "how what follows is valued: max, the target network's highest value (original), or "
        "double, its value of the online network's choice (van Hasselt et al. 2016)",
        choices=("max", "double"),
    )
    loss: str = setting(
        "squared",
        "squared: mean over all outputs (original), or huber: mean over the actions taken, δ = 1 "
        "(notebooks)",
        choices=("squared", "huber"),
    )
    epsilon_schedule: str = setting(
        "episodes",
        "how ε, the share of random actions, falls: by a factor before each episode (original), or "
        "exponentially with the steps made (notebooks)",
        choices=("episodes", "steps"),
    )
    epsilon_start: float = setting(0.9, "ε before the first decay (original: 0.9)", low=0, high=1)
    epsilon_decay: float = setting(
        0.99, "episodes: factor on ε before each episode (original: 0.99)", low=0, high=1
    )
    epsilon_decay_steps: float = setting(
        1000.0, "steps: ε - epsilon_min falls to 1/e in so many (notebooks: 1000)", low=1, high=1e9
    )
    epsilon_min: float = setting(0.01, "ε never falls below this (original: 0.01)", low=0, high=1)
    update_after: str = setting(
        "reset",
        "when updates come: after each episode (original); after each reset, beside the episode's "
        "steps, which act as if they were still to come; or one after each step from the first "
        "full batch on (notebooks)",
        choices=("episode", "reset", "step"),
    )
    learning_starts: int = setting(
        40,
        "update_after episode or reset: for episodes with a higher number than this (original: 40)",
        low=0,
        high=1_000_000,
    )
    updates_per_episode: int = setting(
        30,
        "update_after episode or reset: gradient updates (original: 1, `update-starvation`)",
        low=1,
        high=10_000,
    )
    optimizer: str = setting(
        "adam",
        "adam (Kingma & Ba 2015, original), or adamw with AMSGrad (Loshchilov & Hutter 2019, Reddi "
        "et al. 2018, notebooks)",
        choices=("adam", "adamw"),
    )
    optimizer_epsilon: float = setting(
        1e-7, "what keeps Adam from dividing by 0 (Keras: 1e-7; PyTorch: 1e-8)", low=0, high=1
    )
    weight_decay: float = setting(
        0.0,
        "adamw: share of each weight taken off, times the step size (notebooks: 0.01)",
        low=0,
        high=1,
    )
    gradient_clip: float | None = setting(
        None,
        "each gradient value is cut to ± this (original: not cut; notebooks: 100)",
        low=1e-9,
        high=1e9,
    )
    learning_rate: float = setting(
        1e-3, "Adam's first step size (original: 1e-3)", low=1e-9, high=10
    )
    learning_rate_schedule: str = setting(
        "cosine",
        "constant (original), or a cosine from the first step size to 0 at the last update",
        choices=("constant", "cosine"),
    )
    target_update: str = setting(
        "soft",
        "how the target network follows: soft (Lillicrap et al. 2016), hard (Mnih et al. 2015), "
        "or none (original, `no-target-network`: the online network is its own target)",
        choices=("soft", "hard", "none"),
    )
    target_blend: float = setting(
        0.1,
        "soft: share of the online weights blended in after each update (notebooks: 0.005)",
        low=0,
        high=1,
    )
    target_period: int = setting(
        200,
        "hard: updates from one copy to the next (a usual value; no original)",
        low=1,
        high=1_000_000,
    )
    remembered_action: str = setting(
        "index",
        "what the replay buffer keeps: the index, or the index got back from the torque by "
        "truncation (walkthrough, `index-truncation`)",
        choices=("index", "truncated"),
    )
    save_every: int = setting(
        10, "episodes from one checkpoint to the next (walkthrough: 10)", low=1, high=1_000_000
    )

    def __post_init__(self) -> None:
        for spec in fields(self):
            value = checked_setting(spec.name, getattr(self, spec.name))
            object.__setattr__(self, spec.name, value)
        self._check_task()
        self._check_size()
        if self.update_after == "step" and self.learning_rate_schedule == "cosine":
            raise ConfigError(
                "learning_rate_schedule cosine needs update_after episode or reset: how many "
                "steps, and so updates, there will be is not known before"
            )
        stored = self.replay_capacity
        if TASKS[self.environment].never_terminates and self.update_after != "step":
            over = self.learning_starts + (1 if self.update_after == "reset" else 2)
            stored = min(stored, over * self.episode_steps)
        if self.batch_size > stored:
            raise ConfigError(
                f"batch_size {self.batch_size} is larger than the {stored} transitions that "
                "replay_capacity and learning_starts leave for the first batch"
            )

    def _check_task(self) -> None:
        """Raises ConfigError for settings of one environment that another one has not."""
        if TASKS[self.environment].has_torque:
            if self.gravity is None:
                raise ConfigError(f"gravity is missing; {self.environment} needs it")
        else:
            foreign = {
                "gravity": (self.gravity, None),
                "torque_count": (self.torque_count, Config.torque_count),
                "remembered_action": (self.remembered_action, Config.remembered_action),
            }
            for name, (value, unused) in foreign.items():
                if value != unused:
                    raise ConfigError(
                        f"{name} {value} belongs to Pendulum-v1; {self.environment} has no torque"
                    )
        if self.remembered_action == "truncated" and self.torque_count != 41:
            raise ConfigError(
                "remembered_action 'truncated' belongs to the walkthrough's 41 torques, "
                f"not to torque_count {self.torque_count}"
            )

    def _check_size(self) -> None:
        """Raises ConfigError where the run's checkpoint would be too large to be read."""
        task = TASKS[self.environment]
        outputs = task.action_count or self.torque_count
        widths = (task.observation_size, *self.hidden_units, outputs)
        weights = sum((inputs + 1) * units for inputs, units in pairwise(widths))
        copies = 4 if self.optimizer == "adam" else 5  # online, target, and the optimizer's moments
        transition = 8 * task.observation_size + 9  # bytes
        size = 4 * copies * weights + self.replay_capacity * transition + 64 * self.episodes
        if size > LARGEST_FILE - 2**20:
            raise ConfigError(
                f"hidden_units and replay_capacity make a checkpoint of {size / 2**30:.1f} GiB, "
                "where less than 1 can be read: make them smaller"
            )

    @property
    def total_updates(self) -> int:
        """Updates that the whole run makes when they come with episodes, not with steps."""
        return max(0, self.episodes - self.learning_starts - 1) * self.updates_per_episode


def checked_setting(name: str, value: Any) -> Any:
    """`value` as the field `name` of Config keeps it: 3 for a float becomes 3.0.

    Raises ConfigError for a value of another kind or outside the field's range.
    """
    return checked(Config.__dataclass_fields__[name], value)
