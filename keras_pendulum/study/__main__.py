"""The command `python -m keras_pendulum.study`."""

# PYTHON_ARGCOMPLETE_OK
from __future__ import annotations

import argparse
import importlib.util
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from keras_pendulum.cli import OneLineParser, nonempty_path, run_command
from keras_pendulum.completion import complete_with, names_with_commas, paths
from keras_pendulum.config.presets import PRESETS
from keras_pendulum.errors import UserError
from keras_pendulum.study.arms import Arm, default_arms, own_arms, study_name
from keras_pendulum.tensorflow_setup import require_tensorflow

if TYPE_CHECKING:
    from keras_pendulum.study.job import Job, Reply
    from keras_pendulum.study.results_folder import ResultsFolder

_MAX_SEEDS = 100_000
_MAX_WORKERS = 512


def main(argv: Sequence[str] | None = None, prog: str = "python -m keras_pendulum.study") -> int:
    """Parses the command line and makes the study; returns the exit status."""
    parser = OneLineParser(
        prog=prog,
        description="Train variants of the agent with many seeds, and compare their regrets with "
        "confidence intervals. Without --presets and --arm: from `original` to `reference` one "
        "change at a time, `reference` without each change, and with index-truncation.",
        epilog="Ctrl-C stops. Run the same command again to continue, or with more seeds to extend "
        "the study.",
    )
    presets = parser.add_argument(
        "--presets", type=_preset_names, default=[], metavar="A,B,…", help="these presets as arms"
    )
    parser.add_argument(
        "--arm",
        action="append",
        default=[],
        metavar='"NAME: PRESET field=value …"',
        help="an arm: a preset with some settings changed; may be repeated",
    )
    parser.add_argument(
        "--seeds", type=int, default=10, metavar="N", help="runs of each arm: seeds 0 to N-1 [10]"
    )
    out = parser.add_argument(
        "--out", type=nonempty_path, metavar="DIR", help="folder of the study [studies/ARMS]"
    )
    place = parser.add_mutually_exclusive_group()
    place.add_argument(
        "--workers",
        type=int,
        metavar="N",
        help="worker processes on this machine [one per core]",
    )
    place.add_argument(
        "--scheduler",
        type=nonempty_path,
        metavar="ADDRESS",
        help="use the workers of this Dask scheduler, such as tcp://10.0.0.1:8786",
    )
    complete_with(presets, names_with_commas(PRESETS))
    complete_with(out, paths)
    arguments = parser.parse_args(argv)
    return run_command(lambda: _study(arguments))


def _study(arguments: argparse.Namespace) -> int:
    _require_range("--seeds", arguments.seeds, _MAX_SEEDS)
    if arguments.workers is not None:
        _require_range("--workers", arguments.workers, _MAX_WORKERS)
    chosen = bool(arguments.presets or arguments.arm)
    arms = own_arms(arguments.presets, arguments.arm) if chosen else default_arms()
    require_tensorflow()
    for package in ("scipy", "distributed"):
        if importlib.util.find_spec(package) is None:
            raise UserError(f'{package} is not installed: pip install -e ".[study]" in the clone')

    from keras_pendulum.study.results_folder import ResultsFolder

    name = study_name(arms) if chosen else "original-to-reference"
    path = Path(arguments.out or Path("studies") / name)
    folder = ResultsFolder(path, arms, arguments.seeds)
    folder.require_usable()
    total = folder.job_count
    failures: list[str] = []
    try:
        missing = folder.missing_jobs(_print_problem)
        if finished := total - len(missing):
            print(f"{finished} of {total} runs are already finished", flush=True)
        if missing:
            failures = _make_runs(folder, missing, arguments)
        else:
            with folder.create_and_lock():  # writes `study.json` again if it was lost
                pass
    except KeyboardInterrupt:
        _print_problem(
            f"Interrupted: {total - len(folder.missing_jobs())} of {total} runs are in "
            f"{folder.path}; run the same command again to continue"
        )
        raise
    _write_tables(folder, arms)
    if failures:
        reasons = "; ".join(failures[:5])
        more = f"; and {len(failures) - 5} more" if len(failures) > 5 else ""
        _print_problem(
            f"error: {len(failures)} of {total} runs failed ({reasons}{more}); run the same "
            "command again to retry them"
        )
    return 1 if failures else 0


def _make_runs(
    folder: ResultsFolder, jobs: Sequence[Job], arguments: argparse.Namespace
) -> list[str]:
    """Makes the runs and prints a line for each; returns one for each that has failed."""
    from dask.system import CPU_COUNT

    from keras_pendulum.study.dask_workers import cluster_workers, dashboard, local_workers
    from keras_pendulum.study.job import train_and_score
    from keras_pendulum.study.runner import run_all

    failures: list[str] = []
    replies: list[Reply] = []
    started = time.perf_counter()
    if arguments.scheduler:
        connected = cluster_workers(arguments.scheduler, folder.versions)
    else:
        connected = local_workers(min(arguments.workers or CPU_COUNT, len(jobs)))
    with connected as client, folder.create_and_lock():
        if address := dashboard(client):
            print(f"Dashboard: {address}", flush=True)
        for job, reply, problem in run_all(client, train_and_score, jobs, _print_problem):
            if reply is None:
                failures.append(f"{job}: {problem}")
                _print_problem(f"{job}: failed, {problem}")
                continue
            result = folder.save(job, reply)
            replies.append(reply)
            waiting = len(jobs) - len(replies)
            left = int((time.perf_counter() - started) * waiting / len(replies))
            print(
                f"{job}: regret {result.regret:.2f}, {reply.total:.1f} s, "
                f"{folder.job_count - waiting}/{folder.job_count}, "
                f"{left // 60}:{left % 60:02} left",
                flush=True,
            )
        workers = max(1, len(client.nthreads()))
    if replies:
        _print_cost(replies, time.perf_counter() - started, workers)
    return failures


def _print_cost(replies: Sequence[Reply], seconds: float, workers: int) -> None:
    count = len(replies)
    per_run = seconds * workers / count
    training = sum(reply.training for reply in replies) / count
    evaluation = sum(reply.evaluation for reply in replies) / count
    print(
        f"{count} runs in {seconds:.0f} s, workers: {workers}, runs per core-hour: "
        f"{3600 / per_run:.0f}; mean seconds per run: {training:.2f} training, "
        f"{evaluation:.2f} evaluation, {per_run - training - evaluation:.2f} overhead (start of "
        "the workers and wait for the last run included)"
    )


def _write_tables(folder: ResultsFolder, arms: Sequence[Arm]) -> None:
    from keras_pendulum.study import figure, table

    results = folder.results()
    rows = table.make_rows(arms, results)
    if not rows:
        return
    files = {
        "table.md": table.as_markdown(rows).encode(),
        "table.csv": table.as_csv(rows).encode(),
        "table.json": table.as_json(rows, folder.versions).encode(),
        "figure.png": figure.draw_study(rows, results),
    }
    for name, content in files.items():
        folder.write(name, content)
    print(f"\n{files['table.md'].decode()}\nSaved in {folder.path}: {', '.join(files)}, results/")


def _print_problem(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


def _require_range(flag: str, value: int, maximum: int) -> None:
    if not 1 <= value <= maximum:
        raise UserError(f"{flag} is {value}; expected a whole number from 1 to {maximum}")


def _preset_names(text: str) -> list[str]:
    return [nonempty_path(part.strip()) for part in text.split(",")]


if __name__ == "__main__":
    sys.exit(main())
