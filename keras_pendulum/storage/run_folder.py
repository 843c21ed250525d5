"""The folder of a run: the only reader and writer of its files.

`find_run` finds the run in a folder; `--resume`, `compare`, `page` and `diagnose` call it.
"""

from __future__ import annotations

import contextlib
import itertools
import json
import math
import os
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path

from keras_pendulum.config.config import Config
from keras_pendulum.environments.task import Task
from keras_pendulum.environments.tasks import TASKS
from keras_pendulum.errors import UserError, report_os_error
from keras_pendulum.history import EpisodeRecord, csv_header
from keras_pendulum.storage.atomic_write import retry_while_open, write_atomically
from keras_pendulum.storage.find_weights import checkpoints_in
from keras_pendulum.storage.folder_lock import lock_folder
from keras_pendulum.storage.small_files import read_small_file, require_folder, require_regular


class RunFolder:
    """The files of a run.

    Args:
        path: the folder; it may not exist yet.
        environment: of the run.

    Raises UserError when the folder cannot be read, and when one of the run's files, or its folder
    `tensorboard`, is a link or of another kind.
    """

    def __init__(self, path: str | os.PathLike[str], environment: str) -> None:
        if not os.fspath(path) or "\0" in os.fspath(path):
            raise UserError("the name of the run's folder is empty, or has a null character")
        self.path = Path(path)
        # The real path: a link that changes during the run must not change the folder.
        self._real_path = Path(os.path.realpath(path))
        networks = {name: _network_files(self._real_path, task) for name, task in TASKS.items()}
        self.weights, self.best, self.snapshots = networks[environment]
        self.history = self._real_path / "history.csv"
        self.config = self._real_path / "config.json"
        self.picture = self._real_path / "rewards.png"
        # Of a finished run; `best` is there only with `keep_best`, `snapshots` with `snapshots`.
        self.files = [*networks.pop(environment), self.history, self.config, self.picture]
        self._others = [*itertools.chain(*networks.values())]  # of a run in another environment
        self.events = self._real_path / "tensorboard"
        self._evaluated = False  # whether history.csv has the column of the evaluations
        self.require_not_moved: Callable[[], None] = lambda: None  # see folder_lock.lock_folder
        with report_os_error(f"cannot read the folder {path}"):
            # Through a link, the run would replace or remove files of another folder.
            require_regular(*(self.path / file.name for file in (*self.files, *self._others)))
            require_folder(self.path / self.events.name)

    @contextlib.contextmanager
    def lock(self) -> Iterator[None]:
        """Locks the folder against other runs, and creates it if it does not exist.

        The system releases the lock of a killed run. Raises UserError when another run holds the
        lock, or when the folder cannot be created.
        """
        with report_os_error(f"cannot make the folder {self.path}"):
            self._real_path.mkdir(parents=True, exist_ok=True)
        with lock_folder(self._real_path) as self.require_not_moved:
            yield

    def require_unused(self, overwrite: bool) -> None:
        """Raises UserError when the folder holds a run and `overwrite` is false."""
        files = [*self.files, *self._others]
        used = [file.name for file in files if file.exists()]
        used += [self.events.name] if self._event_files() else []
        if used and not overwrite:
            raise UserError(
                f"{self.path} already holds a run ({', '.join(used)}): continue it with --resume, "
                "replace it with --overwrite, or name another folder with --out"
            )

    def require_run(self) -> None:
        """Raises UserError when the folder holds no checkpoint to resume."""
        if not self.weights.exists():
            names = [task.weights_name for task in TASKS.values()]
            missing = [name for name in names if not (self._real_path / name).exists()]
            raise UserError(
                f"{self.path} holds no run to continue (no {' or '.join(missing)}): leave out "
                "--resume to start a run, or name the folder of one with --out"
            )

    def remove_old_run(self) -> None:
        """Removes the files of another run, after the new run's first checkpoint is written.

        Raises UserError when one cannot be removed.
        """
        _remove(self.best, self.snapshots, *self._others)
        if events := self._event_files():
            _remove(*events)
            with contextlib.suppress(OSError):  # the folder holds other files too
                self.events.rmdir()

    def start_files(self, config: Config, history: Sequence[EpisodeRecord]) -> None:
        """Writes the settings and the history so far, and removes temporary files and the picture.

        Raises UserError when the folder cannot be written.
        """
        for file in (*self.files, *self._others):
            _remove(*self._real_path.glob(f".{file.name}.*.tmp"))
        _remove(self.picture)
        self._evaluated = config.evaluate_every > 0 or not all(
            math.isnan(record.greedy_regret) for record in history
        )
        write_atomically(self.config, (json.dumps(asdict(config), indent=2) + "\n").encode())
        self._write_history(history)

    def warn_if_edited(self, config: Config) -> None:
        """Warns when config.json does not hold these settings, those of the checkpoint."""
        with contextlib.suppress(OSError, ValueError, RecursionError, UserError):
            found = json.loads(read_small_file(self.config))
            if found != json.loads(json.dumps(asdict(config))):
                warnings.warn(
                    f"{self.path / self.config.name} is not used: the settings of the run are in "
                    "its checkpoint; change one by its flag",
                    stacklevel=2,
                )

    def append(self, record: EpisodeRecord) -> None:
        """Adds a row to history.csv, unless the file was removed; see `restore_history`.

        Raises UserError when the row cannot be written.
        """
        self.require_not_moved()
        # Not mode "a": it would make a file without the rows before.
        open_file = partial(open, self.history, "r+", encoding="ascii", newline="")
        with (
            report_os_error(f"cannot write {self.history}"),
            contextlib.suppress(FileNotFoundError),
            retry_while_open(open_file) as file,
        ):
            file.seek(0, os.SEEK_END)
            file.write(record.csv_row(self._evaluated) + "\n")

    def restore_history(self, history: Iterable[EpisodeRecord]) -> None:
        """Writes history.csv again if it was removed during the run.

        Raises UserError when it cannot be written.
        """
        if not self.history.exists():
            self._write_history(history)

    def _write_history(self, history: Iterable[EpisodeRecord]) -> None:
        evaluated = self._evaluated
        lines = [csv_header(evaluated), *(record.csv_row(evaluated) for record in history)]
        write_atomically(self.history, "".join(line + "\n" for line in lines).encode())

    def _event_files(self) -> list[Path]:
        # By their names: a folder called tensorboard may hold other files.
        return [each for each in self.events.glob("events.out.tfevents.*") if each.is_file()]


def find_run(path: str | os.PathLike[str]) -> RunFolder:
    """Returns the folder of a run that has a checkpoint.

    Raises UserError for anything else, and for a folder with the checkpoints of two environments.
    """
    folder = Path(path)
    names = {task.weights_name: task.environment for task in TASKS.values()}
    try:
        found = checkpoints_in(folder)
        if not found and not folder.is_dir():
            kind = "a file" if folder.exists() else "no such folder"
            raise UserError(f"{folder}: {kind}; expected the folder of a run")
    except OSError as error:
        raise UserError(f"{folder}: {error.strerror}; expected the folder of a run") from error
    if not found:
        raise UserError(f"{folder}: holds no run (no {' or '.join(names)})")
    if len(found) > 1:
        raise UserError(f"{folder}: holds {' and '.join(found)}: move one to another folder")
    return RunFolder(folder, names[found[0]])


def find_run_if_folder(path: object) -> RunFolder | None:
    """Returns the folder of a run, None where `path` is not a folder. Raises as `find_run` does."""
    try:
        is_folder = isinstance(path, (str, os.PathLike)) and Path(path).is_dir()
    except (OSError, ValueError):  # a name that no file can have
        is_folder = False
    return find_run(path) if is_folder else None  # type: ignore[arg-type]


def _network_files(folder: Path, task: type[Task]) -> list[Path]:
    """Returns the checkpoint, such as `pendulum_weight.h5`, and `…_best.h5`, `…_snapshots.h5`."""
    file = folder / task.weights_name
    return [file, *(file.with_stem(f"{file.stem}_{kind}") for kind in ("best", "snapshots"))]


def _remove(*files: Path) -> None:
    for file in files:
        with report_os_error(f"cannot replace {file}"):
            retry_while_open(partial(file.unlink, missing_ok=True))
