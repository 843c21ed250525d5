"""The folder of a study: its settings, a file for each result, and the jobs that are missing."""

from __future__ import annotations

import csv
import json
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from keras_pendulum.config.config import Config
from keras_pendulum.config.settings import read_settings
from keras_pendulum.errors import ConfigError, UserError, report_os_error
from keras_pendulum.storage.atomic_write import retry_while_open, write_atomically
from keras_pendulum.storage.folder_lock import LOCK_FILE, lock_folder
from keras_pendulum.storage.small_files import read_small_file, require_folder, require_regular
from keras_pendulum.study.arms import Arm
from keras_pendulum.study.job import (
    Job,
    Reply,
    RunResult,
    decode,
    installed_versions,
    learning_settings,
    require_versions,
)


class ResultsFolder:
    """The results of all arms with the seeds 0, 1, ….

    Arms with the same training share their runs; the files have the first arm's name.
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

        Without its `study.json`, a folder is usable when all its results belong to this study. A
        link in place of one of its files or folders is refused.
        """
        with report_os_error(f"cannot read the folder {self.path}"):
            try:
                names = {file.name for file in self._folder.iterdir()} - {LOCK_FILE}
            except FileNotFoundError:
                return
            # Through a link, the study would write in another folder.
            require_regular(self._manifest, self._log)
            slugs = {arm.slug for arm in self._first_arms.values()}
            require_folder(self._results, *(self._results / slug for slug in sorted(slugs)))
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
        with report_os_error(f"cannot make the folder {self.path}"):
            self._folder.mkdir(parents=True, exist_ok=True)
        with lock_folder(self._folder) as self._require_in_place:
            self.require_usable()
            if not self._manifest.exists():
                content = {"versions": self.versions, "arms": self._description()}
                text = json.dumps(content, indent=2, ensure_ascii=False) + "\n"
                write_atomically(self._manifest, text.encode())
            with report_os_error(f"cannot write in {self.path}"):
                for arm in self._first_arms.values():
                    (self._results / arm.slug).mkdir(parents=True, exist_ok=True)
            yield

    def jobs(self) -> list[Job]:
        """Returns every run of the study, seed by seed, so that all arms get results equally."""
        return [
            self._job(arm, seed) for seed in range(self._seeds) for arm in self._first_arms.values()
        ]

    def missing_jobs(self, report: Callable[[str], None] = lambda line: None) -> list[Job]:
        """Returns the jobs without a valid result; `report` gets a line for each invalid file.

        Raises UserError for a result that is a link, a device or larger than any result.
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
        with report_os_error(f"cannot write in {self.path}"):
            require_folder(self._results, self._file(job).parent)
            require_regular(self._file(job), self._log)
        write_atomically(self._file(job), reply.result)
        seconds = (f"{each:.3f}" for each in (reply.training, reply.evaluation, reply.total))
        with (
            report_os_error(f"cannot write {self._log}"),
            retry_while_open(lambda: open(self._log, "a", encoding="utf-8", newline="")) as file,
        ):
            log = csv.writer(file, lineterminator="\n")
            if file.tell() == 0:
                log.writerow(("arm", "seed", "worker", "training", "evaluation", "total"))
            log.writerow((job.arm, job.config.seed, reply.worker, *seconds))
        return result

    def write(self, name: str, content: bytes) -> None:
        """Writes a table or a figure. Raises UserError when that fails."""
        file = self._folder / name
        with report_os_error(f"cannot write {file}"):
            require_regular(file)
        write_atomically(file, content)

    def results(self) -> dict[str, list[RunResult]]:
        """Returns the valid results by the arm's name, in the order of their seeds."""
        return {
            arm.name: [
                result
                for seed in range(self._seeds)
                if (result := self._read(self._job(self._first_arms[arm.training_config], seed)))
            ]
            for arm in self._arms
        }

    def _job(self, arm: Arm, seed: int) -> Job:
        return Job(arm.name, arm.slug, arm.config.change(seed=seed), self.versions)

    def _file(self, job: Job) -> Path:
        return self._results / job.slug / f"{job.slug}-seed{job.config.seed}.json"

    def _read(self, job: Job) -> RunResult | None:
        with report_os_error(f"cannot read {self._file(job)}"):
            try:
                return decode(read_small_file(self._file(job)), job)
            except FileNotFoundError:
                return None

    def _description(self) -> list[dict[str, Any]]:
        return [
            {"name": arm.name, "baseline": arm.baseline, "config": learning_settings(arm.config)}
            for arm in self._arms
        ]

    def _require_same_study(self) -> None:
        try:
            with report_os_error(f"cannot read {self._manifest}"):
                manifest = json.loads(read_small_file(self._manifest))
        except (ValueError, RecursionError) as error:
            raise UserError(
                f"{self._manifest} is damaged: remove it and run the same command again, which "
                "uses the results found; or name another folder with --out"
            ) from error
        # Other JSON, perhaps nested deeply.
        with suppress(AttributeError, KeyError, TypeError, ConfigError, RecursionError):
            require_versions(manifest["versions"], self.versions, f"{self.path}: this machine")
            # Older files also record settings that have no effect.
            arms = [
                {**arm, "config": learning_settings(read_settings(arm["config"]))}
                for arm in manifest["arms"]
            ]
            if arms == self._description():
                return
        raise UserError(
            f"{self.path} holds another study, with other arms or settings: name another folder "
            "with --out"
        )

    def _require_own_results(self, files: Iterable[Path]) -> None:
        arms = {arm.slug: arm for arm in self._first_arms.values()}
        for file in files:
            arm = arms.get(file.parent.name)
            seed = file.stem.rpartition("-seed")[2]
            is_number = seed.isascii() and seed.isdigit() and len(seed) <= 6
            job = self._job(arm, int(seed)) if arm and is_number else None
            if job is None or self._file(job) != file or self._read(job) is None:
                raise UserError(
                    f"{file} is not a result of this study, and study.json is missing: run the "
                    "command that made the results, with its presets and arms, or name another "
                    "folder with --out"
                )
