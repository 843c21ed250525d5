"""The folder of a run: its checkpoint, history, settings and picture."""

from __future__ import annotations

import contextlib
import json
import math
import os
import shutil
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from pathlib import Path

from keras_pendulum.atomic_file import write_atomically
from keras_pendulum.config import Config
from keras_pendulum.environment import TASKS
from keras_pendulum.episodes import EpisodeRecord
from keras_pendulum.errors import UserError
from keras_pendulum.folder_lock import held

_COLUMNS = ["return" if name == "episode_return" else name for name in EpisodeRecord._fields]


class RunFolder:
    """Names the files of a run and writes the plain-text ones.

    Args:
        path: the folder.
        environment: that of the run; None takes it from the checkpoint that lies there.
    """

    def __init__(self, path: str | os.PathLike[str], environment: str | None = None) -> None:
        self.path = Path(path)
        checkpoints = [self.path / task.weights_name for task in TASKS.values()]
        if environment is not None:
            self.weights = self.path / TASKS[environment].weights_name
        else:
            there = [file for file in checkpoints if file.exists()]
            # Two lie there where one run was replacing another and was killed: the newer goes on.
            self.weights = max(there, key=lambda file: file.stat().st_mtime, default=checkpoints[0])
        self._others = [file for file in checkpoints if file != self.weights]
        self.history = self.path / "history.csv"
        self.config = self.path / "config.json"
        self.picture = self.path / "rewards.png"
        self.events = self.path / "tensorboard"

    @property
    def files(self) -> list[Path]:
        """Every file that a run leaves here."""
        return [self.weights, self.history, self.config, self.picture]

    def make(self) -> None:
        """Makes the folder, if need be. Raises UserError when it cannot be made."""
        try:
            self.path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise UserError(f"cannot make the folder {self.path}: {error.strerror}") from error

    @contextlib.contextmanager
    def held(self) -> Iterator[None]:
        """Keeps other runs out of the folder meanwhile; the system lets go of a killed run's.

        Raises UserError when another run holds it.
        """
        if not self.path.is_dir():
            yield  # nothing to resume, which the checkpoint's reader tells
            return
        with held(self.path):
            yield

    def claim(self, overwrite: bool) -> None:
        """Raises UserError when the folder holds a run already and `overwrite` is false."""
        used = [file.name for file in (*self.files, *self._others) if file.exists()]
        if used and not overwrite:
            raise UserError(
                f"{self.path} already holds a run ({', '.join(used)}): go on with it by --resume, "
                "replace it by --overwrite, or name another folder by --out"
            )

    def begin(self, config: Config, history: Iterable[EpisodeRecord]) -> None:
        """Writes the settings, and the history of the episodes before a resumed run goes on.

        To be called once the run's own checkpoint is there: what was here before of another run
        or of a killed one goes. Raises UserError when the folder cannot be written.
        """
        history = list(history)
        if not history:
            shutil.rmtree(self.events, ignore_errors=True)
        for file in (self.picture, *self._others, *self.path.glob(".*.h5.*.tmp")):
            try:
                file.unlink(missing_ok=True)
            except OSError as error:
                raise UserError(f"cannot replace {file}: {error.strerror}") from error
        write_atomically(self.config, (json.dumps(asdict(config), indent=2) + "\n").encode())
        lines = [",".join(_COLUMNS), *map(_row, history)]
        write_atomically(self.history, "".join(line + "\n" for line in lines).encode())

    def append(self, record: EpisodeRecord) -> None:
        """Adds a row to the history. Raises UserError when it cannot be written."""
        try:
            with open(self.history, "a", encoding="ascii") as file:
                file.write(_row(record) + "\n")
        except OSError as error:
            raise UserError(f"cannot write {self.history}: {error.strerror}") from error


def _row(record: EpisodeRecord) -> str:
    # A missing loss is an empty cell, which pandas reads as NaN.
    return ",".join("" if math.isnan(value) else repr(value) for value in record)
