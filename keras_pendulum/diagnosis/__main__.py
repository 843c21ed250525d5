"""The command `python -m keras_pendulum.diagnose`: what is wrong with an agent."""

from __future__ import annotations

import argparse
import contextlib
import sys
from collections.abc import Sequence
from pathlib import Path

from keras_pendulum.cli import (
    OneLineParser,
    add_environment_flag,
    add_torques_flag,
    nonempty_path,
    print_json,
    prints_to_stderr,
    require_ending,
    run_command,
)
from keras_pendulum.completion import complete_with, weights_files
from keras_pendulum.status import status
from keras_pendulum.storage.atomic_write import require_no_other_file, write_atomically
from keras_pendulum.storage.shipped_weights import shipped_names
from keras_pendulum.tensorflow_setup import fast_import


def main(argv: Sequence[str] | None = None, prog: str = "python -m keras_pendulum.diagnose") -> int:
    """Runs the command; returns its exit status."""
    parser = OneLineParser(
        prog=prog,
        description="Compare an agent with the exact solution of its task, and name its fault.",
    )
    agent = parser.add_argument(
        "agent",
        type=nonempty_path,
        metavar="AGENT|RUN_FOLDER",
        help="a weights file, the name of a shipped one, file.py:name, package.module:name, or a "
        "run folder (its history and replay buffer are used, too)",
    )
    add_environment_flag(parser)
    parser.add_argument(
        "--gravity",
        type=float,
        metavar="G",
        help="gravity in m/s² [recorded in the file, else the better one of 10 and 1]",
    )
    parser.add_argument(
        "--discount",
        type=float,
        metavar="γ",
        help="discount [recorded in the file, else shown by the values, else 0.9; 0.99 for "
        "CartPole]",
    )
    add_torques_flag(parser)
    parser.add_argument(
        "--reward-scale",
        type=float,
        metavar="FACTOR",
        help="factor on the rewards in training [recorded in the file, else 1]",
    )
    parser.add_argument(
        "--record",
        type=nonempty_path,
        metavar="RUN.npz",
        help="what a kp.Recorder saved of the training (docs/agents.md)",
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument(
        "--report", type=nonempty_path, metavar="FILE.html", help="save a page with a picture"
    )
    complete_with(agent, weights_files(shipped_names))
    arguments = parser.parse_args(argv)
    return run_command(lambda: _diagnose(arguments))


def _diagnose(arguments: argparse.Namespace) -> int:
    if arguments.report:
        require_ending("--report", arguments.report, ".html")
        require_no_other_file(Path(arguments.report), b"<!DOCTYPE html>", "an HTML file")

    with fast_import():
        from keras_pendulum.diagnosis.diagnose import diagnose
        from keras_pendulum.diagnosis.report import as_html
        from keras_pendulum.evaluate.named_policy import named_policy
        from keras_pendulum.storage.run_folder import find_run_if_folder

    agent, torques = arguments.agent, arguments.torques
    with prints_to_stderr() if arguments.json else contextlib.nullcontext():
        if find_run_if_folder(agent) is None:
            policy = named_policy(agent, torques, environment=arguments.environment)
            policy.name = agent
            agent, torques = policy, None
        with status("Playing, and comparing with the exact solution") as report:
            diagnosis = diagnose(
                agent,
                environment=arguments.environment,
                gravity=arguments.gravity,
                discount=arguments.discount,
                torques=torques,
                reward_scale=arguments.reward_scale,
                record=arguments.record,
                on_progress=report,
            )
            content, summary = diagnosis.as_json(), diagnosis.summary()
    if arguments.report:
        write_atomically(arguments.report, as_html(diagnosis).encode())
    if arguments.json:
        print_json(content)
        return 0
    print(summary)
    if arguments.report:
        print(f"Wrote {arguments.report}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
