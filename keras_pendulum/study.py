"""The command `python -m keras_pendulum.study`."""

# PYTHON_ARGCOMPLETE_OK
from __future__ import annotations

import argparse
import importlib.util
import os
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from keras_pendulum.arms import Arm, default_arms, own_arms
from keras_pendulum.backend import require_tensorflow
from keras_pendulum.command_line import OneLineParser, name, run_command
from keras_pendulum.errors import UserError

if TYPE_CHECKING:
    from keras_pendulum.study_folder import StudyFolder
    from keras_pendulum.study_loop import Engine
    from keras_pendulum.study_result import Job

_MOST_SEEDS = 100_000
_MOST_WORKERS = 512


def main(argv: Sequence[str] | None = None) -> int:
    """Parses the command line and makes the study; returns the exit status."""
    parser = OneLineParser(
        prog="python -m keras_pendulum.study",
        description="Train variants of the agent with many seeds, and tell with intervals how good "
        "each becomes. Without --presets and --arm: from `original` to `reference` one change at a "
        "time, `reference` without each change, and with index-truncation.",
        epilog="Ctrl-C stops; the same command goes on, and so does one with more seeds.",
    )
    parser.add_argument(
        "--presets", type=_names, default=[], metavar="A,B,…", help="these presets as arms"
    )
    parser.add_argument(
        "--arm",
        action="append",
        default=[],
        metavar="'NAME: PRESET field=value …'",
        help="a preset with settings changed as an arm; may be given many times",
    )
    parser.add_argument(
        "--seeds", type=int, default=10, metavar="N", help="runs of each arm: seeds 0 to N-1 [10]"
    )
    parser.add_argument("--out", type=name, metavar="DIR", help="folder [studies/ARMS]")
    where = parser.add_mutually_exclusive_group()
    where.add_argument(
        "--workers", type=int, metavar="N", help="processes on this machine [one a core]"
    )
    where.add_argument(
        "--scheduler", type=name, metavar="ADDRESS", help="of a Dask cluster (extra `cluster`)"
    )
    arguments = parser.parse_args(argv)
    return run_command(lambda: _study(arguments))


def _study(arguments: argparse.Namespace) -> int:
    _require_range("--seeds", arguments.seeds, _MOST_SEEDS)
    if arguments.workers is not None:
        _require_range("--workers", arguments.workers, _MOST_WORKERS)
    own = bool(arguments.presets or arguments.arm)
    arms = own_arms(arguments.presets, arguments.arm) if own else default_arms()
    require_tensorflow()
    if importlib.util.find_spec("scipy") is None:
        raise UserError("scipy is not installed: pip install 'keras_pendulum[study]'")

    from keras_pendulum.study_folder import StudyFolder

    slugs = "-vs-".join(arm.slug for arm in arms) if own else "original-to-reference"
    folder = StudyFolder(
        Path(arguments.out or Path("studies") / slugs[:100]), arms, arguments.seeds
    )
    try:
        with _engine(arguments, folder) as engine, folder.opened():
            failed = _make_runs(folder, engine)
    except KeyboardInterrupt:
        everything = len(folder.jobs())
        print(
            f"Interrupted: {everything - len(folder.missing())} of {everything} runs are in "
            f"{folder.path}; the same command goes on with the others",
            file=sys.stderr,
        )
        raise
    _report(folder, arms)
    if failed:
        told = "; ".join(f"{_called(job)}: {problem}" for job, problem in failed[:5])
        more = f"; and {len(failed) - 5} more" if len(failed) > 5 else ""
        print(
            f"error: {len(failed)} of {len(folder.jobs())} runs failed ({told}{more}); the same "
            "command tries them again",
            file=sys.stderr,
        )
    return 1 if failed else 0


@contextmanager
def _engine(arguments: argparse.Namespace, folder: StudyFolder) -> Iterator[Engine]:
    if arguments.scheduler:
        from keras_pendulum.cluster import dask_cluster

        with dask_cluster(arguments.scheduler, folder.versions) as engine:
            yield engine
        return
    from keras_pendulum.study_loop import Engine
    from keras_pendulum.worker_processes import WorkerProcesses

    count = arguments.workers or len(os.sched_getaffinity(0))
    executor = WorkerProcesses(count)
    try:
        yield Engine(executor, count, lambda: count)
    finally:
        executor.shutdown(cancel_futures=True)


def _make_runs(folder: StudyFolder, engine: Engine) -> list[tuple[Job, str]]:
    """Makes what is missing, a line for each run; returns the runs that failed, and why."""
    from keras_pendulum.study_loop import run_all
    from keras_pendulum.study_run import train_and_score

    everything, missing = folder.jobs(), folder.missing()
    before = done = len(everything) - len(missing)
    if done:
        print(f"{done} of {len(everything)} runs are there already", flush=True)
    failed: list[tuple[Job, str]] = []
    training = evaluation = 0.0
    begun = time.perf_counter()
    for job, outcome, problem in run_all(engine, train_and_score, missing, _tell_retry):
        if outcome is None:
            failed.append((job, problem))
            print(f"{_called(job)}: failed, {problem}", file=sys.stderr, flush=True)
            continue
        result = folder.keep(job, outcome)
        done += 1
        training += outcome.training
        evaluation += outcome.evaluation
        left = (time.perf_counter() - begun) * (len(everything) - done) / (done - before)
        print(
            f"{_called(job)}: regret {result.regret:.2f}, {outcome.total:.1f} s, "
            f"{done}/{len(everything)}, {int(left) // 60}:{int(left) % 60:02} left",
            flush=True,
        )
    seconds, made = time.perf_counter() - begun, done - before
    if made:
        workers = max(1, engine.workers())
        rest = seconds * workers - training - evaluation
        print(
            f"{made} runs in {seconds:.0f} s on {workers} workers: "
            f"{3600 * made / (seconds * workers):.0f} seeds per core-hour; a run took "
            f"{training / made:.2f} s of training, {evaluation / made:.2f} s of evaluation and "
            f"{rest / made:.2f} s of all else, the workers' start and their idle end included"
        )
    return failed


def _report(folder: StudyFolder, arms: Sequence[Arm]) -> None:
    from keras_pendulum import study_picture, study_table

    results = folder.results()
    rows = study_table.make_rows(arms, results)
    if not rows:
        return
    files = {
        "table.md": study_table.as_markdown(rows).encode(),
        "table.csv": study_table.as_csv(rows).encode(),
        "table.json": study_table.as_json(rows, folder.versions).encode(),
        "figure.png": study_picture.study_figure(rows, results),
    }
    for file, content in files.items():
        folder.write(file, content)
    print(f"\n{files['table.md'].decode()}\nSaved in {folder.path}: {', '.join(files)}, results/")


def _tell_retry(job: Job, problem: str) -> None:
    print(f"{_called(job)}: tried again, {problem}", file=sys.stderr, flush=True)


def _called(job: Job) -> str:
    return f"{job.arm}, seed {job.config.seed}"


def _require_range(flag: str, value: int, most: int) -> None:
    if not 1 <= value <= most:
        raise UserError(f"{flag} is {value}; expected a whole number from 1 to {most}")


def _names(text: str) -> list[str]:
    return [name(part.strip()) for part in text.split(",")]


if __name__ == "__main__":
    sys.exit(main())
