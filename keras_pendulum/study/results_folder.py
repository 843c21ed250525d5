"""The folder of a study: its settings, a file for each result, and the jobs that are missing."""

from __future__ import annotations

import csv
import io
import json
import os
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from keras_pendulum.config.config import Config
from keras_pendulum.errors import UserError
from keras_pendulum.storage.atomic_write import retry_while_open, write_atomically
from keras_pendulum.storage.folder_lock import LOCK_FILE, lock_folder
from keras_pendulum.study.arms import Arm
from keras_pendulum.study.job import (
    Job,
    Reply,
    RunResult,
    config_as_json,
    decode,
    installed_versions,
    require_versions,
)

_LOG_COLUMNS = ("arm", "seed", "worker", "training", "evaluation", "total")


class ResultsFolder:
    """The results of all arms with the seeds 0, 1, ….

    Arms with the same training share their runs; the files have the first arm's name.

    Args:
        path: the folder.
        arms: of the study.
        seeds: number of runs of each arm.
    """

    def __init__(self, path: Path, arms: Sequence[Arm], seeds: int) -> None:
        self.path = path
        self.versions = installed_versions()
        self._arms = arms
        self._seeds = seeds
        # If a link in the path changes during the study, the results stay in one folder.
        self._folder = Path(os.path.realpath(path))
        self._require_in_place: Callable[[], None] = lambda: None
        self._manifest = self._folder / "study.json"
        self._log = self._folder / "seconds.csv"
        self._results = self._folder / "results"
        self._first_arms: dict[Config, Arm] = {}
        for arm in arms:
            self._first_arms.setdefault(arm.training_config, arm)
        self.job_count = len(self._first_arms) * seeds

    def require_usable(self) -> None:
        """Raises UserError when the folder holds another study or something else.

        Without its `study.json`, a folder is usable when all its results belong to this study.
        """
        try:
            names = {file.name for file in self._folder.iterdir()} - {LOCK_FILE}
        except FileNotFoundError:
            return
        except OSError as error:
            raise UserError(f"cannot read the folder {self.path}: {error.strerror}") from error
        if self._manifest.name in names:
            self._require_same_study()
        elif results := sorted(self._results.glob("*/*.json")):
            self._require_own_results(results)
        elif any(not name.startswith(f".{self._manifest.name}.") for name in names):
            raise UserError(
                f"{self.path} holds something other than a study: name another folder with --out"
            )

    @contextmanager
    def create_and_lock(self) -> Iterator[None]:
        """Creates the folder if it is missing, and keeps other studies out of it.

        Raises UserError when the folder is not usable or is in use, or cannot be written.
        """
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise UserError(f"cannot make the folder {self.path}: {error.strerror}") from error
        with lock_folder(self._folder) as self._require_in_place:
            self.require_usable()
            if not self._manifest.exists():
                write_atomically(self._manifest, _encode_json(self._description()))
            try:
                for arm in self._first_arms.values():
                    (self._results / arm.slug).mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise UserError(f"cannot write in {self.path}: {error.strerror}") from error
            if not self._log.exists():
                write_atomically(self._log, (",".join(_LOG_COLUMNS) + "\n").encode())
            yield

    def jobs(self) -> list[Job]:
        """Returns every run of the study, seed by seed, so that all arms get results equally."""
        return [
            self._job(arm, seed) for seed in range(self._seeds) for arm in self._first_arms.values()
        ]

    def missing_jobs(self, report: Callable[[str], None] = lambda line: None) -> list[Job]:
        """Returns the jobs without a valid result.

        Args:
            report: called with a line for each file that holds no valid result.
        """
        missing = [job for job in self.jobs() if self._read(job) is None]
        for file in map(self._file, missing):
            if file.exists():
                report(f"{file} is damaged or was changed: its run is made again")
        return missing

    def save(self, job: Job, reply: Reply) -> RunResult:
        """Writes a result atomically, and its cost to the log; returns the result.

        Raises UserError when the result is damaged or cannot be written, or the folder was moved.
        """
        result = decode(reply.result, job)
        if result is None:
            raise UserError(
                f"{reply.worker} sent a damaged result of {job}: run the command again to retry it"
            )
        self._require_in_place()
        write_atomically(self._file(job), reply.result)
        seconds = (reply.training, reply.evaluation, reply.total)
        line = io.StringIO()
        csv.writer(line, lineterminator="\n").writerow(
            [job.arm, job.config.seed, reply.worker, *(f"{value:.3f}" for value in seconds)]
        )
        try:
            with retry_while_open(
                lambda: open(self._log, "a", encoding="utf-8", newline="")
            ) as file:
                file.write(line.getvalue())
        except OSError as error:
            raise UserError(f"cannot write {self._log}: {error.strerror}") from error
        return result

    def write(self, name: str, content: bytes) -> None:
        """Writes a table or a figure. Raises UserError when that fails."""
        write_atomically(self._folder / name, content)

    def results(self) -> dict[str, list[RunResult]]:
        """Returns the valid results by the arm's name, in the order of their seeds."""
        found: dict[Config, list[RunResult]] = {config: [] for config in self._first_arms}
        for job, config in zip(self.jobs(), [*self._first_arms] * self._seeds, strict=True):
            result = self._read(job)
            if result is not None:
                found[config].append(result)
        return {arm.name: found[arm.training_config] for arm in self._arms}

    def _job(self, arm: Arm, seed: int) -> Job:
        return Job(arm.name, arm.slug, replace(arm.config, seed=seed), self.versions)

    def _file(self, job: Job) -> Path:
        return self._results / job.slug / f"{job.slug}-seed{job.config.seed}.json"

    def _read(self, job: Job) -> RunResult | None:
        try:
            return decode(self._file(job).read_bytes(), job)
        except FileNotFoundError:
            return None
        except OSError as error:
            raise UserError(f"cannot read {self._file(job)}: {error.strerror}") from error

    def _description(self) -> dict[str, Any]:
        arms = [
            {"name": arm.name, "baseline": arm.baseline, "config": config_as_json(arm.config)}
            for arm in self._arms
        ]
        return {"versions": self.versions, "arms": arms}

    def _require_same_study(self) -> None:
        other_study = UserError(
            f"{self.path} holds another study, with other arms or settings: name another folder "
            "with --out"
        )
        try:
            manifest = json.loads(self._manifest.read_bytes())
        except OSError as error:
            raise UserError(f"cannot read {self._manifest}: {error.strerror}") from error
        except ValueError as error:
            raise UserError(
                f"{self._manifest} is damaged: remove it and run the same command again, which "
                "uses the results found; or name another folder with --out"
            ) from error
        if not isinstance(manifest, dict) or not isinstance(manifest.get("versions"), dict):
            raise other_study
        require_versions(manifest["versions"], self.versions, f"{self.path}: this machine")
        if manifest.get("arms") != json.loads(_encode_json(self._description()))["arms"]:
            raise other_study

    def _require_own_results(self, files: Iterable[Path]) -> None:
        jobs = (
            self._job(arm, int(name[1]))
            for file in files
            for arm in self._first_arms.values()
            if (name := re.fullmatch(rf"{re.escape(arm.slug)}-seed(\d{{1,6}})", file.stem))
        )
        own = {self._file(job) for job in jobs if self._read(job) is not None}
        for file in files:
            if file not in own:
                raise UserError(
                    f"{file} is no result of this study, and study.json is missing: run the "
                    "command that made the results, with its presets and arms, or name another "
                    "folder with --out"
                )


def _encode_json(content: Any) -> bytes:
    return (json.dumps(content, indent=2, ensure_ascii=False) + "\n").encode()
