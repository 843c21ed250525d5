"""The folder of a run: its checkpoint, history, settings and picture."""

from __future__ import annotations

import contextlib
import json
import math
import os
from collections.abc import Callable, Iterable, Iterator
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

    Raises UserError when the folder cannot be read, or holds the checkpoints of two environments
    and none is named.
    """

    def __init__(self, path: str | os.PathLike[str], environment: str | None = None) -> None:
        self.path = Path(path)
        try:
            # Else a link that is turned meanwhile would lead a run into another one's folder.
            self._place = Path(os.path.realpath(path))
            checkpoints = [self._place / task.weights_name for task in TASKS.values()]
            there = [file for file in checkpoints if file.exists()]
        except OSError as error:
            raise UserError(f"cannot read the folder {path}: {error.strerror}") from error
        if environment is not None:
            self.weights = self._place / TASKS[environment].weights_name
        elif len(there) > 1:
            names = " and ".join(file.name for file in there)
            raise UserError(f"{path} holds {names}: move one of them to another folder")
        else:
            self.weights = (there or checkpoints)[0]
        self._others = [file for file in checkpoints if file != self.weights]
        self.history = self._place / "history.csv"
        self.config = self._place / "config.json"
        self.picture = self._place / "rewards.png"
        self.events = self._place / "tensorboard"
        self.require_in_place: Callable[[], None] = lambda: None  # see folder_lock.held

    @property
    def files(self) -> list[Path]:
        """Every file that a run leaves here."""
        return [self.weights, self.history, self.config, self.picture]

    def make(self) -> None:
        """Makes the folder, if need be. Raises UserError when it cannot be made."""
        try:
            self._place.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise UserError(f"cannot make the folder {self.path}: {error.strerror}") from error

    @contextlib.contextmanager
    def held(self) -> Iterator[None]:
        """Keeps other runs out of the folder meanwhile; the system lets go of a killed run's.

        Raises UserError when another run holds it.
        """
        if not self._place.is_dir():
            yield  # nothing to resume, which the checkpoint's reader tells
            return
        with held(self._place) as self.require_in_place:
            yield

    def claim(self, overwrite: bool) -> None:
        """Raises UserError when the folder holds a run already and `overwrite` is false."""
        used = [file.name for file in (*self.files, *self._others) if file.exists()]
        used += [self.events.name] if self._event_files() else []
        if used and not overwrite:
            raise UserError(
                f"{self.path} already holds a run ({', '.join(used)}): go on with it by --resume, "
                "replace it by --overwrite, or name another folder by --out"
            )

    def replace_others(self) -> None:
        """Removes what another run left here, once the checkpoint of a new one is there.

        Raises UserError when it cannot be removed.
        """
        _remove(*self._others)
        if events := self._event_files():
            _remove(*events)
            with contextlib.suppress(OSError):  # which holds something else too
                self.events.rmdir()

    def begin(self, config: Config, history: Iterable[EpisodeRecord]) -> None:
        """Writes the settings, and the history of the episodes before a resumed run goes on.

        What a killed run was writing goes. Raises UserError when the folder cannot be written.
        """
        for file in (*self.files, *self._others):
            _remove(*self._place.glob(f".{file.name}.*.tmp"))
        _remove(self.picture)
        write_atomically(self.config, (json.dumps(asdict(config), indent=2) + "\n").encode())
        lines = [",".join(_COLUMNS), *map(_row, history)]
        write_atomically(self.history, "".join(line + "\n" for line in lines).encode())

    def append(self, record: EpisodeRecord) -> None:
        """Adds a row to the history. Raises UserError when it, or the folder, is out of reach."""
        self.require_in_place()
        try:
            with open(self.history, "a", encoding="ascii") as file:
                file.write(_row(record) + "\n")
        except OSError as error:
            raise UserError(f"cannot write {self.history}: {error.strerror}") from error

    def _event_files(self) -> list[Path]:
        # By name, because a folder called tensorboard may hold anything.
        return list(self.events.glob("events.out.tfevents.*"))


def _remove(*files: Path) -> None:
    for file in files:
        try:
            file.unlink(missing_ok=True)
        except OSError as error:
            raise UserError(f"cannot replace {file}: {error.strerror}") from error


def _row(record: EpisodeRecord) -> str:
    # A missing loss is an empty cell, which pandas reads as NaN.
    return ",".join("" if math.isnan(value) else repr(value) for value in record)
