"""The settings, the faults as switches, and the starts with which the page trains a network."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from keras_pendulum.config.config import Config
from keras_pendulum.config.presets import preset
from keras_pendulum.environments.task import Task
from keras_pendulum.errors import ConfigError
from keras_pendulum.optimum.solutions import solution
from keras_pendulum.train.evaluations import SEEDS

_SMALL = (64, 64)  # hidden units; a run of `reference` takes about 16 s in a browser
_OTHER_SIZES = [(16, 16), (128, 64), (512, 256, 128)]  # that the page offers, too
_EVALUATE_EVERY = 25  # episodes
# Settings that no Config has: each changes the program to one with a fault.
OWN_SETTINGS: dict[str, Any] = {
    "bootstrap": "maximum",  # of the next Q-values; mean, or none: the target is the reward
    "reward_factor": 1.0,
    "stored_end": "terminated",  # over: a truncated episode is stored as one that ended
}


@dataclass(frozen=True)
class Switch:
    """A fault that a user of the page switches on."""

    title: str
    sentence: str
    changes: dict[str, Any]  # settings of the Config, or of OWN_SETTINGS


# By their names in the address of the page.
SWITCHES = {
    "one-update": Switch(
        "One update per episode",
        "The network hardly learns, because it sees each transition too rarely.",
        {"updates_per_episode": 1},
    ),
    "no-target": Switch(
        "No target network",
        "The targets come from the network that is learning, so each update moves its own goal.",
        {"target_update": "none"},
    ),
    "constant-rate": Switch(
        "Constant learning rate",
        "The last updates are as large as the first ones, so the last network is a noisy one.",
        {"learning_rate_schedule": "constant"},
    ),
    "small-buffer": Switch(
        "Small replay buffer",
        "It holds only the last 200 steps, so the network forgets states that it no longer meets.",
        {"replay_capacity": 200},
    ),
    "truncated-index": Switch(
        "Truncated indices",
        "An index that is computed back from the torque is cut off, not rounded: two torques are "
        "never learned, and their random values look better than all learned ones.",
        {"stored_index": "truncated"},
    ),
    "short-sight": Switch(
        "γ = 0.5",
        "The sum of the rewards fades within a few steps, too early for an effort that pays later.",
        {"discount": 0.5},
    ),
    "far-sight": Switch(
        "γ = 0.999",
        "The values are sums over a thousand steps, too large to be learned in so few updates.",
        {"discount": 0.999},
    ),
    "reward-sign": Switch(
        "Reward with the wrong sign",
        "What is bad earns most, so the agent learns the worst behaviour.",
        {"reward_factor": -1.0},
    ),
    "reward-scale": Switch(
        "Rewards times 100",
        "The values are a hundred times larger, and the weights grow too slowly to reach them.",
        {"reward_factor": 100.0},
    ),
    "no-exploration": Switch(
        "ε = 0",
        "The agent never tries an action at random: random starts and early errors explore for it.",
        {"epsilon_start": 0.0, "epsilon_min": 0.0},
    ),
    "only-exploration": Switch(
        "ε = 1",
        "Every action is random, so the agent seldom sees where its own policy leads.",
        {"epsilon_start": 1.0, "epsilon_min": 1.0},
    ),
    "no-bootstrapping": Switch(
        "No bootstrapping",
        "The target is the reward alone, without γ max Q(s′), so no action counts beyond its step.",
        {"bootstrap": "none"},
    ),
    "mean-for-maximum": Switch(
        "Mean for maximum",
        "The target takes the mean of the next Q-values, those of a policy that acts at random.",
        {"bootstrap": "mean"},
    ),
    "truncation-as-end": Switch(
        "Truncation stored as an end",
        "The last step of a truncated episode gets no γ max Q(s′), as if the task ended there.",
        {"stored_end": "over"},
    ),
}


def learning_config(task: Task) -> Config:
    """Returns the settings of a healthy run in the page: a preset's, with a small network.

    The preset of a pendulum is the one with the nearest gravity.
    """
    if task.gravity is None:
        base = preset("cartpole")
    else:
        near = abs(task.gravity - 1) <= abs(task.gravity - 10)
        base = preset("reference" if near else "swingup", gravity=task.gravity)
    return base.change(hidden_units=_SMALL, evaluate_every=_EVALUATE_EVERY)


def switched(config: Config, switch: Switch) -> dict[str, Any]:
    """Returns the settings that a fault changes; it changes none where the task cannot have it."""
    own = {name: value for name, value in switch.changes.items() if name in OWN_SETTINGS}
    try:
        changed = config.change(**{k: v for k, v in switch.changes.items() if k not in own})
    except ConfigError:  # such as truncated indices of a task without torques
        return {}
    healthy = vars(config)
    return {k: v for k, v in vars(changed).items() if v != healthy[k]} | own


def highest_return(task: Task) -> float:
    """Returns the mean of the highest returns from the starts that the page evaluates."""
    return float(solution(task).best_returns(SEEDS).mean())


def learning_content(task: Task) -> dict[str, Any]:
    """Returns the settings by the names of the Config, the switches, and starts [N, D]."""
    config = learning_config(task)
    switches = [
        {"name": name, "title": switch.title, "sentence": switch.sentence, "changes": changes}
        for name, switch in SWITCHES.items()
        if (changes := switched(config, switch))
    ]
    return {
        "settings": {**vars(config), **OWN_SETTINGS},
        "action_count": task.action_count(config.torque_count),
        "starts": task.starts(SEEDS).tolist(),
        "highest_return": highest_return(task),
        "switches": switches,
        "networks": _OTHER_SIZES,
    }
