"""The folder of a study: what it is, a file for each run's result, and what is still to be made."""

from __future__ import annotations

import csv
import io
import json
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from keras_pendulum.arms import Arm
from keras_pendulum.atomic_file import write_atomically
from keras_pendulum.config import Config
from keras_pendulum.errors import UserError
from keras_pendulum.folder_lock import held
from keras_pendulum.study_result import Job, Result, decode, installed_versions
from keras_pendulum.study_run import Outcome, require_versions

_LOG_COLUMNS = ("arm", "seed", "worker", "training", "evaluation", "total")


class StudyFolder:
    """Results of the arms' runs with the seeds 0, 1, …; arms that train alike share theirs.

    Args:
        path: the folder.
        arms: the study's.
        seeds: how many runs of each arm are wanted.
    """

    def __init__(self, path: Path, arms: Sequence[Arm], seeds: int) -> None:
        self.path = path
        self.versions = installed_versions()
        self._arms = arms
        self._seeds = seeds
        # As for a run's folder: a link that is turned meanwhile does not lead astray.
        self._place = Path(os.path.realpath(path))
        self._require_in_place: Callable[[], None] = lambda: None
        self._manifest = self._place / "study.json"
        self._log = self._place / "seconds.csv"
        self._results = self._place / "results"
        self._maker: dict[Config, Arm] = {}
        for arm in arms:
            self._maker.setdefault(arm.training, arm)

    @contextmanager
    def opened(self) -> Iterator[None]:
        """Makes the folder or goes on with it, and keeps other studies out meanwhile.

        Raises UserError when it holds another study or something else, or cannot be written.
        """
        try:
            self._place.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise UserError(f"cannot make the folder {self.path}: {error.strerror}") from error
        with held(self._place) as self._require_in_place:
            if self._manifest.exists():
                self._require_same_study()
            else:
                if any(not file.name.startswith(".study.json.") for file in self._place.iterdir()):
                    raise UserError(
                        f"{self.path} holds something else than a study: name another folder by "
                        "--out"
                    )
                write_atomically(self._manifest, _json(self._described()))
            try:
                for arm in self._maker.values():
                    (self._results / arm.slug).mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise UserError(f"cannot write in {self.path}: {error.strerror}") from error
            if not self._log.exists():
                write_atomically(self._log, (",".join(_LOG_COLUMNS) + "\n").encode())
            yield

    def jobs(self) -> list[Job]:
        """Every run of the study: seed by seed, so that all arms grow alike."""
        return [
            Job(arm.name, arm.slug, replace(arm.config, seed=seed), self.versions)
            for seed in range(self._seeds)
            for arm in self._maker.values()
        ]

    def missing(self) -> list[Job]:
        """The runs that have no sound result yet."""
        return [job for job in self.jobs() if self._read(job) is None]

    def keep(self, job: Job, outcome: Outcome) -> Result:
        """Writes a result atomically, and what it cost to the log.

        Raises UserError when it is damaged or cannot be written, or the folder was moved.
        """
        result = decode(outcome.result, job)
        if result is None:
            raise UserError(f"{outcome.worker} sent a damaged result of {job.arm}")
        self._require_in_place()
        write_atomically(self._file(job), outcome.result)
        seconds = (outcome.training, outcome.evaluation, outcome.total)
        line = io.StringIO()
        csv.writer(line, lineterminator="\n").writerow(
            [job.arm, job.config.seed, outcome.worker, *(f"{value:.3f}" for value in seconds)]
        )
        try:
            with open(self._log, "a", encoding="utf-8") as file:
                file.write(line.getvalue())
        except OSError as error:
            raise UserError(f"cannot write {self._log}: {error.strerror}") from error
        return result

    def write(self, name: str, content: bytes) -> None:
        """Puts what the results tell beside them. Raises UserError when it cannot be written."""
        write_atomically(self._place / name, content)

    def results(self) -> dict[str, list[Result]]:
        """The sound results of each arm by its name, in the order of their seeds."""
        made: dict[Config, list[Result]] = {training: [] for training in self._maker}
        for job, training in zip(self.jobs(), [*self._maker] * self._seeds, strict=True):
            result = self._read(job)
            if result is not None:
                made[training].append(result)
        return {arm.name: made[arm.training] for arm in self._arms}

    def _file(self, job: Job) -> Path:
        return self._results / job.slug / f"{job.slug}-seed{job.config.seed}.json"

    def _read(self, job: Job) -> Result | None:
        try:
            return decode(self._file(job).read_bytes(), job)
        except FileNotFoundError:
            return None
        except OSError as error:
            raise UserError(f"cannot read {self._file(job)}: {error.strerror}") from error

    def _described(self) -> dict[str, Any]:
        arms = [
            {"name": arm.name, "against": arm.against, "config": asdict(arm.config)}
            for arm in self._arms
        ]
        return {"versions": self.versions, "arms": arms}

    def _require_same_study(self) -> None:
        other = UserError(
            f"{self.path} holds another study, with other arms or settings: name another folder "
            "by --out"
        )
        try:
            there = json.loads(self._manifest.read_bytes())
        except OSError as error:
            raise UserError(f"cannot read {self._manifest}: {error.strerror}") from error
        except ValueError as error:
            raise UserError(f"{self._manifest} is damaged: name another folder by --out") from error
        if not isinstance(there, dict) or not isinstance(there.get("versions"), dict):
            raise other
        require_versions(there["versions"], self.versions, f"{self.path}: this machine")
        if there.get("arms") != json.loads(_json(self._described()))["arms"]:
            raise other


def _json(content: Any) -> bytes:
    return (json.dumps(content, indent=2, ensure_ascii=False) + "\n").encode()
