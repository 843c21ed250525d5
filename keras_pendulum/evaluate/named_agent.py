"""The agent that a word of the command line names."""

from __future__ import annotations

import os

from numpy.typing import ArrayLike

from keras_pendulum.errors import UserError
from keras_pendulum.evaluate.agents import Agent, as_agent
from keras_pendulum.evaluate.keras_files import load_keras_file
from keras_pendulum.evaluate.user_code import load_code, names_code
from keras_pendulum.storage.find_weights import find_weights


def named_agent(
    word: str, torques: ArrayLike | None = None, activation: str | None = None
) -> tuple[Agent, str]:
    """Returns the agent and its name: the path of its file, or the word.

    Args:
        word: a file, the name of a shipped one, `file.py:name` or `package.module:name`. The last
            two run the user's code.
        torques: see `as_agent`.
        activation: see `load_weights`.

    Raises UserError for a word that names no agent.
    """
    if not names_code(word):
        path = os.fspath(find_weights(word))
        return as_agent(load_keras_file(path, activation), torques), path
    if activation is not None:
        raise UserError("--activation belongs to a weights file; your code has its own")
    try:
        return as_agent(load_code(word), torques), word
    except TypeError as error:
        raise UserError(f"{word}: {error}") from error
