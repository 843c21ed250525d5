"""The arms of a study: named variants of the agent, each with the settings of its runs."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

from keras_pendulum.config.config import Config
from keras_pendulum.config.presets import preset
from keras_pendulum.config.settings import parse_setting
from keras_pendulum.environments.tasks import task_name
from keras_pendulum.errors import ConfigError
from keras_pendulum.study.arm_labels import describe_setting

# The defects of `original` that these settings fix. The default study fixes them first.
_FIXED_DEFECTS = {"updates_per_episode": "update-starvation", "target_update": "no-target-network"}
# The defects that only `walkthrough` has.
_OTHER_DEFECTS: dict[str, dict[str, Any]] = {"index-truncation": {"stored_index": "truncated"}}
_ANY_SAVE_EVERY = Config.save_every
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
    label: str = ""  # in the figure; empty for its name

    @property
    def slug(self) -> str:
        """The name in file names."""
        slug = re.sub(r"[^a-z0-9_.=]+", "-", self.name.lower()).strip("-.") or "arm"
        return f"arm-{slug}" if _RESERVED.match(slug) else slug

    @property
    def shown_name(self) -> str:
        """The name in the figure."""
        return self.label or self.name

    @property
    def training_config(self) -> Config:
        """The settings that decide a run, without its seed; arms that share them share runs."""
        return replace(self.config, preset="", seed=0, save_every=_ANY_SAVE_EVERY)

    @property
    def task(self) -> str:
        """Environment and gravity; regrets of different tasks cannot be compared."""
        return task_name(self.config.environment, self.config.gravity)


def default_arms() -> list[Arm]:
    """Returns the default study's arms.

    From `original` to `reference` one change at a time, then `reference` without each change, and
    `reference` with each defect that `original` does not have.
    """
    original, reference = preset("original"), preset("reference")
    changed = [
        spec.name
        for spec in fields(Config)
        if spec.name != "preset" and getattr(original, spec.name) != getattr(reference, spec.name)
    ]
    fixes = list(_FIXED_DEFECTS)
    changed.sort(key=lambda name: fixes.index(name) if name in fixes else len(fixes))
    arms = [Arm("original", original)]
    for name in changed:
        value = getattr(reference, name)
        config = replace(arms[-1].config, **{name: value})
        label = f"+ {describe_setting(name, value)}"
        arms.append(Arm(f"+ {name}={value}", config, arms[-1].name, False, label))
    last = f"{arms[-1].label} = reference"
    arms[-1] = replace(arms[-1], name="reference", has_curve=True, label=last)
    for name in changed:
        config = replace(reference, **{name: getattr(original, name)})
        defect = f" ({_FIXED_DEFECTS[name]})" if name in _FIXED_DEFECTS else ""
        label = f"reference with {describe_setting(name, getattr(original, name))}"
        name = f"reference without {name}{defect}"
        arms.append(Arm(name, config, "reference", label=label))
    for defect, settings in _OTHER_DEFECTS.items():
        config = replace(reference, **settings)
        label = " and ".join(describe_setting(*item) for item in settings.items())
        label = f"reference with {label}"
        arms.append(Arm(f"reference with {defect}", config, "reference", label=label))
    return arms


def own_arms(presets: Sequence[str], texts: Sequence[str]) -> list[Arm]:
    """Returns the user's arms: presets, and texts of the form `NAME: PRESET field=value …`.

    Each is compared with the first arm of the same task. Raises ConfigError for a text of another
    form, and for two arms of one name.
    """
    arms = [Arm(name, preset(name)) for name in presets] + [_parse_arm(text) for text in texts]
    _require_names(arms)
    first: dict[str, str] = {}  # name of the first arm by task
    compared = []
    for arm in arms:
        compared.append(replace(arm, baseline=first.get(arm.task)))
        first.setdefault(arm.task, arm.name)
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
        if field in ("seed", "preset"):
            raise ConfigError(
                f"the arm {name.strip()!r} cannot set {field}: the study's seeds are 0, 1, …, and "
                "the preset comes before the settings"
            )
        if field in ("evaluate_every", "keep_best", "snapshots"):
            raise ConfigError(
                f"the arm {name.strip()!r} cannot set {field}: a study evaluates each run at its "
                "end, and saves no weights"
            )
        settings[field] = parse_setting(field, value)
    return Arm(name.strip(), preset(words[0], **settings))


def _require_names(arms: Iterable[Arm]) -> None:
    slugs = set()
    for arm in arms:
        if len(arm.slug) > _MAX_NAME or not arm.name.isprintable():
            raise ConfigError(
                f"the arm's name {arm.name[:40]!r} is longer than {_MAX_NAME} letters or not "
                "printable"
            )
        if arm.slug in slugs:
            raise ConfigError(
                f"two arms have the name {arm.name!r} in file names: rename one of them"
            )
        slugs.add(arm.slug)
