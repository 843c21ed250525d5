"""Shell completion: the values that the Tab key offers for an argument (extra `completion`)."""

from __future__ import annotations

import argparse
import importlib.util
import os
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

Completer = Callable[..., Iterable[str]]  # called with the beginning of the word, `prefix`


def completes() -> bool:
    """Returns whether a shell has started this process for completions, and it can make them."""
    return "_ARGCOMPLETE" in os.environ and importlib.util.find_spec("argcomplete") is not None


def complete_with(action: argparse.Action, completer: Completer) -> None:
    """Sets the values that the Tab key offers for an argument."""
    action.completer = completer  # type: ignore[attr-defined]


def names(known: Iterable[str]) -> Completer:
    """Offers these names."""
    return lambda prefix, **_: [name for name in known if name.startswith(prefix)]


def names_with_commas(known: Iterable[str]) -> Completer:
    """Offers these names for each part of a word such as `A,B`."""

    def complete(prefix: str, **_: Any) -> list[str]:
        *before, beginning = prefix.split(",")
        return [
            ",".join((*before, name))
            for name in known
            if name.startswith(beginning) and name not in before
        ]

    return complete


def weights_files(shipped: Callable[[], Iterable[str]]) -> Completer:
    """Offers files with weights, folders, and the shipped names that `shipped` returns."""

    def complete(prefix: str, **_: Any) -> list[str]:
        return [*names(shipped())(prefix), *paths(prefix, ".h5", ".keras")]

    return complete


def paths(prefix: str, *endings: str, **_: Any) -> list[str]:
    """Offers the folders, and the files with these endings, whose path starts with `prefix`.

    A folder ends with a slash. Names that start with a dot are offered when the dot is typed.
    """
    cut = max(prefix.rfind("/"), prefix.rfind(os.sep)) + 1
    parent, beginning = prefix[:cut], prefix[cut:]
    try:
        entries = sorted(Path(parent).expanduser().iterdir())
        found = [entry for entry in entries if entry.name.startswith(beginning)]
        if not beginning:
            found = [entry for entry in found if not entry.name.startswith(".")]
        return [
            parent + entry.name + ("/" if entry.is_dir() else "")
            for entry in found
            if entry.is_dir() or entry.name.endswith(endings)
        ]
    except (OSError, RuntimeError):  # no such folder, an unreadable one, or a user without a home
        return []
