"""The settings that decide what a run learns, with their defaults: the preset `reference`."""

from __future__ import annotations

from dataclasses import dataclass

from keras_pendulum.config.fields import SEED, Integer, Integers, Number, Switch, Text, setting
from keras_pendulum.environments.tasks import TASKS

_WITH_TORQUES = (
    "environment",
    *(name for name, task in TASKS.items() if "torque_count" in task.own_settings),
)


@dataclass(frozen=True)
class Learning:
    """The settings that decide what a run learns."""

    preset: str = setting("reference", "name of the preset that these settings come from", Text())
    environment: str = setting("Pendulum-v1", "Gymnasium's environment", Text(TASKS))
    gravity: float | None = setting(
        1.0,
        "gravity of the pendulum in m/s² (Gymnasium's own default is 10)",
        Number(0, 100, optional=True),
        only=_WITH_TORQUES,
    )
    episodes: int = setting(500, "episodes of the run", Integer(1, 1_000_000))
    max_episode_steps: int = setting(
        100,
        "steps after which a training episode is truncated; an evaluation uses Gymnasium's limit",
        Integer(1, 10_000),
    )
    seed: int = setting(0, "seed of every random draw of the run", SEED)
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
        41,
        "torques of the pendulum, linspace(-2, 2, torque_count) N·m",
        Integer(2, 1001),
        only=_WITH_TORQUES,
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
        0.99, "factor on ε before an episode", Number(0, 1), only=("epsilon_schedule", "episodes")
    )
    epsilon_decay_steps: float = setting(
        1000.0,
        "steps in which ε - epsilon_min falls to 1/e",
        Number(1, 1e9),
        only=("epsilon_schedule", "steps"),
    )
    epsilon_min: float = setting(0.01, "lowest ε", Number(0, 1))
    train_frequency: str = setting(
        "episode",
        "episode: updates_per_episode updates after each episode; step: one update after each step",
        Text(("episode", "step")),
    )
    warmup_episodes: int = setting(
        41,
        "episodes before the first update",
        Integer(0, 1_000_000),
        only=("train_frequency", "episode"),
    )
    updates_per_episode: int = setting(
        40, "updates after each episode", Integer(1, 10_000), only=("train_frequency", "episode")
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
        0.0,
        "weight decay per update, times the learning rate",
        Number(0, 1),
        only=("optimizer", "adamw"),
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
        0.0, "learning rate at the end", Number(0, 10), only=("learning_rate_schedule", "cosine")
    )
    average_updates: int = setting(
        1,
        "updates over which the final weights are averaged: a moving average, use_ema of Keras "
        "(Polyak & Juditsky 1992), but at most a tenth of the run's updates; 1: the weights of the "
        "last update",
        Integer(1, 1_000_000),
        only=("train_frequency", "episode"),
    )
    target_update: str = setting(
        "soft",
        "soft: the target network moves by tau at each update (Lillicrap et al. 2016); hard: it is "
        "copied every target_period updates (Mnih et al. 2015); none: no target network (defect "
        "no-target-network)",
        Text(("soft", "hard", "none")),
    )
    double_q: bool = setting(
        False,
        "true: the online network chooses the next action, the target network values it (van "
        "Hasselt et al. 2016); false: the target network's highest value",
        Switch(),
        only=("target_update", "soft", "hard"),
    )
    tau: float = setting(
        0.1, "share of the online weights per update", Number(0, 1), only=("target_update", "soft")
    )
    target_period: int = setting(
        200, "updates between two copies", Integer(1, 1_000_000), only=("target_update", "hard")
    )
    stored_index: str = setting(
        "exact",
        "action index in the replay buffer: exact; truncated: computed back from the torque "
        "(defect index-truncation)",
        Text(("exact", "truncated")),
        only=_WITH_TORQUES,
    )
