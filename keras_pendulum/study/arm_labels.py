"""The names of arms in the figure of a study, which need no knowledge of the settings' names."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from keras_pendulum.config.fields import format_value

_COUNTS = ("no", "one", "two", "three")
_Describe = Callable[[Any], str]


def _count(thing: str) -> _Describe:
    def describe(number: int) -> str:
        word = _COUNTS[number] if number < len(_COUNTS) else str(number)
        return f"{word} {thing}{'' if number == 1 else 's'}"

    return describe


def _choice(**texts: str) -> _Describe:
    return lambda value: texts[str(value)]


# By setting. A value that is missing here has its setting's name.
_DESCRIPTIONS: dict[str, _Describe] = {
    "episodes": _count("episode"),
    "max_episode_steps": lambda steps: f"episodes of {steps} steps",
    "updates_per_episode": lambda count: f"{_count('update')(count)} per episode",
    "train_frequency": _choice(episode="updates after each episode", step="an update each step"),
    "warmup_episodes": lambda count: f"{_count('episode')(count)} before the first update",
    "target_update": _choice(
        none="no target network", soft="soft target network", hard="target network by copies"
    ),
    "tau": lambda tau: f"target network moves by {tau:g}",
    "replay_capacity": lambda size: f"replay buffer of {size:,} steps".replace(",", "\u202f"),
    "batch_size": lambda size: f"batches of {size}",
    "learning_rate": lambda rate: f"learning rate {rate:g}",
    "learning_rate_schedule": _choice(
        constant="constant learning rate", cosine="learning rate falls to 0"
    ),
    "learning_rate_min": lambda rate: f"learning rate falls to {rate:g}",
    "average_updates": lambda count: (
        "no average of the weights" if count == 1 else f"weights averaged over {count} updates"
    ),
    "discount": lambda discount: f"discount {discount:g}",
    "reward_scale": lambda scale: f"rewards times {scale:g}",
    "double_q": lambda double: "double Q-learning" if double else "no double Q-learning",
    "loss": _choice(squared="squared loss", huber="Huber loss"),
    "stored_index": _choice(exact="exact indices", truncated="truncated indices"),
    "hidden_units": lambda units: f"layers of {', '.join(map(str, units))}",
    "initial_weights": lambda name: f"initial weights: {name}",
    "optimizer": lambda name: f"optimizer {name}",
    "epsilon_min": lambda epsilon: f"at least {100 * epsilon:g} % random actions",
}


def describe_setting(name: str, value: Any) -> str:
    """Returns a value of a setting in words, such as `one update per episode`."""
    try:
        return _DESCRIPTIONS[name](value)
    except KeyError:
        return f"{name.replace('_', ' ')} {format_value(value)}"
