"""The arms of a study: what is compared, each a name and the settings of its runs."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

from keras_pendulum.command_line import setting_from_text
from keras_pendulum.config import Config
from keras_pendulum.errors import ConfigError
from keras_pendulum.presets import preset

# The departures of `reference` that mend a named defect come first on the way there.
_MENDED = {"updates_per_episode": "update-starvation", "target_update": "no-target-network"}
# The one runnable defect that `original` has not: it is `walkthrough`'s.
_OTHER_DEFECTS: dict[str, dict[str, Any]] = {"index-truncation": {"remembered_action": "truncated"}}
_ANY_SAVE_EVERY = Config.save_every


@dataclass(frozen=True)
class Arm:
    """A line of the study's table.

    `against` names the arm that it is compared with; None where there is none of the same task.
    """

    name: str
    config: Config
    against: str | None = None
    curve: bool = True  # whether the figure shows how it learns

    @property
    def slug(self) -> str:
        """The name as it can stand in a file's name."""
        return re.sub(r"[^a-z0-9_.=]+", "-", self.name.lower()).strip("-.") or "arm"

    @property
    def training(self) -> Config:
        """What decides a run besides its seed: arms that share it share their runs."""
        return replace(self.config, preset="", seed=0, save_every=_ANY_SAVE_EVERY)

    @property
    def task(self) -> str:
        """Environment and gravity; regrets of different tasks cannot be compared."""
        gravity = "" if self.config.gravity is None else f", g = {self.config.gravity:g}"
        return self.config.environment + gravity


def default_arms() -> list[Arm]:
    """From `original` to `reference` one change at a time, then `reference` without each change.

    A last arm gives `reference` the defect `index-truncation`, which `original` has not.
    """
    original, reference = preset("original"), preset("reference")
    changed = [
        spec.name
        for spec in fields(Config)
        if spec.name != "preset" and getattr(original, spec.name) != getattr(reference, spec.name)
    ]
    changed.sort(key=lambda name: list(_MENDED).index(name) if name in _MENDED else len(_MENDED))
    arms = [Arm("original", original)]
    for name in changed:
        config = replace(arms[-1].config, **{name: getattr(reference, name)})
        arms.append(Arm(f"+ {name}={getattr(reference, name)}", config, arms[-1].name, curve=False))
    arms[-1] = replace(arms[-1], name="reference", curve=True)
    for name in changed:
        config = replace(reference, **{name: getattr(original, name)})
        defect = f" ({_MENDED[name]})" if name in _MENDED else ""
        arms.append(Arm(f"reference without {name}{defect}", config, "reference"))
    for defect, settings in _OTHER_DEFECTS.items():
        config = replace(reference, **settings)
        arms.append(Arm(f"reference with {defect}", config, "reference"))
    return arms


def own_arms(presets: Sequence[str], texts: Sequence[str]) -> list[Arm]:
    """Arms that a user names: presets as they are, and texts `NAME: PRESET field=value …`.

    Each is compared with the first one of its task. Raises ConfigError for what is no arm, and for
    two arms of one name.
    """
    arms = [Arm(name, preset(name)) for name in presets] + [_parsed(text) for text in texts]
    _require_names(arms)
    first: dict[str, str] = {}
    compared = []
    for arm in arms:
        compared.append(replace(arm, against=first.get(arm.task)))
        first.setdefault(arm.task, arm.name)
    return compared


def _parsed(text: str) -> Arm:
    name, colon, rest = text.partition(":")
    words = rest.split()
    if not colon or not name.strip() or not words:
        raise ConfigError(f"the arm {text!r} is not of the form 'NAME: PRESET field=value …'")
    settings: dict[str, Any] = {}
    for word in words[1:]:
        field, equals, value = word.partition("=")
        if not equals:
            raise ConfigError(f"the arm {name.strip()!r} has {word!r}; expected field=value")
        if field in ("seed", "preset"):
            raise ConfigError(
                f"the arm {name.strip()!r} cannot set {field}: the study's seeds are 0, 1, …, and "
                "the preset stands before the settings"
            )
        settings[field] = setting_from_text(field, value)
    return Arm(name.strip(), preset(words[0], **settings))


def _require_names(arms: Iterable[Arm]) -> None:
    names: dict[str, str] = {}
    for arm in arms:
        if len(arm.slug) > 100 or not arm.name.isprintable():
            raise ConfigError(f"the arm's name {arm.name[:40]!r} is too long, or not printable")
        if arm.slug in names:
            raise ConfigError(f"two arms have the name {arm.name!r}: files are named by them")
        names[arm.slug] = arm.name
