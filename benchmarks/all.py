"""All benchmarks, one after the other: every table, shipped file and figure of the pages.

    python -m benchmarks.all [--list] [--only NAME …] [--python PYTHON]

Runs the commands of `benchmarks.commands` in their order; `--list` prints them with their minutes.
After each command it notes in runs/benchmarks/finished.json that this one has finished. So the same
command continues after a stop, with the first one that is not finished, and repeats those that have
failed. To begin anew, remove the folder runs/benchmarks. It takes eight hours on two cores; nothing
else should run there, because some commands measure time.

A command whose packages are missing is left out, with one line. PYTHON runs the other libraries, by
default the one of this package.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from benchmarks.commands import COMMANDS, FOLDER, PYTHON, Command, hours
from benchmarks.result_files import ROOT, machine, markdown

WORK = ROOT / "runs" / "benchmarks"
Run = Callable[[Sequence[str]], int]  # a command line -> its exit status


def run_command(line: Sequence[str]) -> int:
    """Runs a command line in the root of the repository; returns its exit status."""
    # Without the user's own number of threads: the same seed gives the same numbers everywhere.
    environment = {key: text for key, text in os.environ.items() if not key.startswith("TF_")}
    return subprocess.run(line, cwd=ROOT, env=environment, check=False).returncode


def missing_packages(packages: Sequence[str], python: str) -> list[str]:
    """Returns the packages that an environment does not have."""
    program = (
        "import importlib.util, sys\n"
        "print(*(name for name in sys.argv[1:] if importlib.util.find_spec(name) is None))"
    )
    line = [python, "-c", program, *packages]
    return subprocess.run(line, capture_output=True, text=True, check=True).stdout.split()


class Finished:
    """The finished commands with their minutes, in a file of the folder `work`.

    Raises SystemExit if the folder was begun on another machine or with other versions.
    """

    def __init__(self, work: Path) -> None:
        self._file = work / "finished.json"
        self._content: dict[str, Any] = {"machine": machine(), "minutes": {}}
        if self._file.exists():
            found = json.loads(self._file.read_text("utf-8"))
            if found["machine"] != machine():
                raise SystemExit(
                    f"error: {work} was begun on {found['machine']}; this is {machine()}: finish "
                    "it there, or remove the folder to begin anew"
                )
            self._content = found

    def __contains__(self, command: Command) -> bool:
        return command.name in self._content["minutes"]

    def add(self, command: Command, minutes: float) -> None:
        """Notes a finished command; a kill leaves the file as it was before, or complete."""
        self._content["minutes"][command.name] = round(minutes, 1)
        self._file.parent.mkdir(parents=True, exist_ok=True)
        new = self._file.with_suffix(".new")
        new.write_text(json.dumps(self._content, indent=2, ensure_ascii=False) + "\n", "utf-8")
        new.replace(self._file)


def command_line(command: Command, work: Path, python: str) -> list[str]:
    """Returns the command line with the folder and the Python that it names."""
    room = command.module.partition(".")[0]  # its commands share their networks
    places = {FOLDER: str(work / room), PYTHON: python}
    arguments = [places.get(each, each) for each in command.arguments]
    return [sys.executable, "-m", f"benchmarks.{command.module}", *arguments]


def chosen_commands(names: Sequence[str]) -> list[Command]:
    """Returns the commands with these names or modules, all without names, in their order.

    Raises SystemExit for an unknown name.
    """
    known = {name for command in COMMANDS for name in (command.name, command.module)}
    for name in names:
        if name not in known:
            raise SystemExit(f"error: --only {name}: not one of {', '.join(sorted(known))}")
    return [each for each in COMMANDS if not names or {each.name, each.module} & {*names}]


def run_all(
    commands: Sequence[Command], finished: Finished, work: Path, python: str, run: Run
) -> int:
    """Runs commands; returns 1 if one has failed. Ends after a failed one that others need."""
    failed = []
    for i, command in enumerate(commands):
        interpreter = python if PYTHON in command.arguments else sys.executable
        if missing := missing_packages(command.packages, interpreter):
            print(
                f"left out: {command.line}: not installed: {', '.join(missing)} "
                f"(extra `{command.extra}`)",
                flush=True,
            )
            continue
        print(
            f"[{i + 1} of {len(commands)}] {command.line}: usually {command.minutes} min; "
            f"{hours(commands[i:])} left",
            flush=True,
        )
        started = time.perf_counter()
        if status := run(command_line(command, work, python)):
            failed.append(command.line)
            print(f"failed with exit status {status}: {command.line}", flush=True)
            if command.needed:
                break
        else:
            finished.add(command, (time.perf_counter() - started) / 60)
    if failed:
        print(f"error: failed: {'; '.join(failed)}. Run the same command again", file=sys.stderr)
    return 1 if failed else 0


def main(argv: Sequence[str] | None = None, *, work: Path = WORK, run: Run = run_command) -> int:
    """Runs the commands that are not finished; returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.all")
    parser.add_argument("--list", action="store_true", help="print the commands, and run none")
    parser.add_argument(
        "--only", nargs="+", default=[], metavar="NAME", help="run these, also finished ones"
    )
    parser.add_argument(
        "--python", default=sys.executable, help="runs the other libraries (extra `peers`)"
    )
    arguments = parser.parse_args(argv)
    chosen = chosen_commands(arguments.only)
    finished = Finished(work)
    if arguments.list:
        rows = [
            {
                "name": command.name,
                "minutes": command.minutes,
                "extra": command.extra or "–",
                "finished": "yes" if command in finished else "no",
            }
            for command in chosen
        ]
        print(f"{markdown(rows)}\nAll of them: {hours(chosen)}.")
        return 0
    commands = [each for each in chosen if arguments.only or each not in finished]
    if not commands:
        print(f"All commands have finished. To begin anew, remove {work}")
    return run_all(commands, finished, work, arguments.python, run)


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit(130)
