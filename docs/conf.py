"""The settings of Sphinx: `python -m sphinx -W --keep-going docs docs/_build`."""

from __future__ import annotations

import inspect
import re
from dataclasses import fields
from typing import Any

from keras_pendulum.config.config import Config
from keras_pendulum.config.fields import format_value
from keras_pendulum.version import __version__

project = "keras_pendulum"
release = __version__
copyright = "the keras_pendulum maintainers"

default_role = "code"  # single backquotes in docstrings
extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",  # links to the source
]
source_suffix = {".md": "markdown"}
exclude_patterns = ["_build", "study"]
myst_heading_anchors = 3  # links such as presets.md#all-settings, as on GitHub

autodoc_typehints = "signature"
autodoc_preserve_defaults = True
autodoc_type_aliases = {"ArrayLike": "ArrayLike"}
autodoc_member_order = "bysource"
# `Raises ConfigError, …` in one sentence stays text; `Args:` and `Raises:` become lists.
napoleon_google_docstring = True
napoleon_numpy_docstring = False

html_theme = "furo"
html_title = f"keras_pendulum {release}"


# NumPy's long name of NDArray[…], as Sphinx writes it.
_ARRAY = re.compile(r"~?numpy\.ndarray\[tuple\[[^\]]*\], ~?numpy\.dtype\[([^\]]*)\]\]")


def readable_signature(
    app: Any, what: str, name: str, value: Any, options: Any, signature: str, returns: str | None
) -> tuple[str, str | None] | None:
    """Returns a signature with the short names of NumPy's types, and that of `DQN.__init__`.

    Keras hides the latter behind a `__new__` of its own.
    """
    if name == "keras_pendulum.DQN":
        own = inspect.signature(value.__init__)
        arguments = [p.replace(annotation=p.empty) for p in own.parameters.values()][1:]
        return str(inspect.Signature(arguments)), None
    if not signature:
        return None
    signature = signature.replace("TypeAliasForwardRef('ArrayLike')", "ArrayLike")
    return signature, returns and _ARRAY.sub(r"NDArray[\1]", returns)


def add_settings(
    app: Any, what: str, name: str, value: Any, options: Any, lines: list[str]
) -> None:
    """Adds the list of all settings to the docstring of `Config`, with their defaults."""
    if name != "keras_pendulum.Config":
        return
    lines.append("")
    for field in fields(Config):
        # Without a backslash, these characters begin emphasis or a link.
        meaning = re.sub(r"([*|_\\])", r"\\\1", field.metadata["help"])
        default = format_value(field.default)
        lines.append(f":param {field.name}: {meaning}. Default: ``{default}``.")
    lines.append("")


def setup(app: Any) -> None:
    """Connects the functions above; Sphinx calls it."""
    app.connect("autodoc-process-signature", readable_signature)
    app.connect("autodoc-process-docstring", add_settings)
