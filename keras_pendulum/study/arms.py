"""The arms of a study: named variants of the agent, each with the settings of its runs."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from keras_pendulum.config.config import Config, Recording
from keras_pendulum.config.fields import format_value
from keras_pendulum.config.presets import preset
from keras_pendulum.config.settings import parse_setting
from keras_pendulum.errors import ConfigError

# The defects of `original` that these settings fix. The default study fixes them first.
_FIXED_DEFECTS = {
    "updates_per_episode": " (update-starvation)",
    "target_update": " (no-target-network)",
}
# The words for a setting in the figure. A value that is missing here has its setting's name.
_DESCRIPTIONS: dict[str, Callable[[Any], str]] = {
    "updates_per_episode": lambda count: (
        "one update per episode" if count == 1 else f"{count} updates per episode"
    ),
    "max_episode_steps": lambda steps: f"episodes of {steps} steps",
    "replay_capacity": lambda size: f"replay buffer of {size:,} steps".replace(",", "\u202f"),
    "hidden_units": lambda units: f"layers of {', '.join(map(str, units))}",
    "double_q": lambda double: "double Q-learning" if double else "no double Q-learning",
    "average_updates": lambda count: (
        "no average of the weights" if count == 1 else f"weights averaged over {count} updates"
    ),
    "target_update": {
        "none": "no target network",
        "soft": "soft target network",
        "hard": "target network by copies",
    }.__getitem__,
    "learning_rate_schedule": {
        "constant": "constant learning rate",
        "cosine": "learning rate falls to 0",
    }.__getitem__,
    "stored_index": {"exact": "exact indices", "truncated": "truncated indices"}.__getitem__,
}
# The settings that no arm has, and why.
_REFUSED = dict.fromkeys(
    ("seed", "preset"),
    "the study's seeds are 0, 1, …, and the preset comes before the settings",
) | dict.fromkeys(
    Recording.__dataclass_fields__,
    "a study evaluates each run at its end, and saves no weights",
)
# Files have the arm's name. With these limits, no path below the folder where the command runs is
# longer than 200 characters: Windows allows 260 in all.
_MAX_NAME = 64
_MAX_STUDY_NAME = 150  # with the name of one arm twice
_RESERVED = re.compile(r"(con|nul|aux|prn|com\d|lpt\d)(\.|$)")  # no file of Windows has such a name


@dataclass(frozen=True)
class Arm:
    """A variant of the agent: one line of the study's table."""

    name: str
    config: Config
    baseline: str | None = None  # name of the arm that it is compared with
    has_curve: bool = True  # whether the figure shows its learning curve
    label: str = ""  # its name in the figure; empty for `name`

    @property
    def slug(self) -> str:
        """The name in file names."""
        slug = re.sub(r"[^a-z0-9_.=]+", "-", self.name.lower()).strip("-.") or "arm"
        return f"arm-{slug}" if _RESERVED.match(slug) else slug

    @property
    def training_config(self) -> Config:
        """The settings that decide a run, without its seed; arms that share them share runs."""
        return Config(**{**self.config.learning(), "preset": "", "seed": 0})

    @property
    def task(self) -> str:
        """The name of the task; regrets of different tasks cannot be compared."""
        return self.config.task.name


def default_arms() -> list[Arm]:
    """Returns the default study's arms.

    From `original` to `reference` one change at a time, then `reference` without each change, and
    `reference` with each defect that `original` does not have.
    """
    original, reference = preset("original"), preset("reference")
    changed = [
        name
        for name, value in vars(original).items()
        if name != "preset" and value != getattr(reference, name)
    ]
    changed.sort(key=lambda name: name not in _FIXED_DEFECTS)
    arms = [Arm("original", original)]
    for name in changed:
        value = getattr(reference, name)
        config = arms[-1].config.change(**{name: value})
        label = f"+ {describe_setting(name, value)}"
        arms.append(Arm(f"+ {name}={value}", config, arms[-1].name, False, label))
    last = f"{arms[-1].label} = reference"
    arms[-1] = replace(arms[-1], name="reference", has_curve=True, label=last)
    undone = [
        (f"reference without {name}{_FIXED_DEFECTS.get(name, '')}", name, getattr(original, name))
        for name in changed
    ]
    # The defect that only `walkthrough` has.
    undone.append(("reference with index-truncation", "stored_index", "truncated"))
    for arm_name, name, value in undone:
        config = reference.change(**{name: value})
        label = f"reference with {describe_setting(name, value)}"
        arms.append(Arm(arm_name, config, "reference", label=label))
    return arms


def describe_setting(name: str, value: Any) -> str:
    """Returns a value of a setting in words, such as `one update per episode`."""
    try:
        return _DESCRIPTIONS[name](value)
    except KeyError:
        return f"{name.replace('_', ' ')} {format_value(value)}"


def own_arms(presets: Sequence[str], texts: Sequence[str]) -> list[Arm]:
    """Returns the user's arms: presets, and texts of the form `NAME: PRESET field=value …`.

    Each is compared with the first arm of the same task. Raises ConfigError for a text of another
    form, and for two arms of one name.
    """
    arms = [Arm(name, preset(name)) for name in presets] + [_parse_arm(text) for text in texts]
    compared: list[Arm] = []
    for arm in arms:
        if len(arm.slug) > _MAX_NAME or not arm.name.isprintable():
            raise ConfigError(
                f"the arm's name {arm.name[:40]!r} is longer than {_MAX_NAME} letters or not "
                "printable"
            )
        if arm.slug in [other.slug for other in compared]:
            raise ConfigError(
                f"two arms have the name {arm.name!r} in file names: rename one of them"
            )
        same_task = (other.name for other in compared if other.task == arm.task)
        compared.append(replace(arm, baseline=next(same_task, None)))
    return compared


def study_name(arms: Sequence[Arm]) -> str:
    """Returns the name of the folder for a study of these arms."""
    slugs = [arm.slug for arm in arms]
    return "-vs-".join(slugs)[: _MAX_STUDY_NAME - 2 * max(map(len, slugs))].rstrip("-.")


def _parse_arm(text: str) -> Arm:
    name, colon, rest = text.partition(":")
    words = rest.split()
    if not colon or not name.strip() or not words:
        raise ConfigError(f'the arm {text!r} is not of the form "NAME: PRESET field=value …"')
    settings: dict[str, Any] = {}
    for word in words[1:]:
        field, equals, value = word.partition("=")
        if not equals:
            raise ConfigError(f"the arm {name.strip()!r} has {word!r}; expected field=value")
        if field in _REFUSED:
            raise ConfigError(f"the arm {name.strip()!r} cannot set {field}: {_REFUSED[field]}")
        if field in settings:
            raise ConfigError(f"the arm {name.strip()!r} sets {field} twice")
        settings[field] = parse_setting(field, value)
    return Arm(name.strip(), preset(words[0], **settings))
