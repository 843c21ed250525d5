"""The blocks of README.md and docs about the presets and their results."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import keras_pendulum as kp
from benchmarks.learning.departures import BEFORE, MEASURED_HERE, departures, measured
from benchmarks.learning.regrets import STATISTIC, mean_and_interval, number, summary
from benchmarks.learning.rejected_settings import ARMS
from benchmarks.learning.study import table
from benchmarks.pages.reasons import REASONS
from benchmarks.result_files import Row, markdown, rows_of
from keras_pendulum.config.fields import format_value
from keras_pendulum.config.presets import DESCRIPTIONS, PRESETS
from keras_pendulum.environments.pendulum import Pendulum
from keras_pendulum.optimum.solutions import solution
from keras_pendulum.study.job import EVALUATION_EPISODES

# The results of `original` are in those of the departures of `reference`.
MEASURED_WITH = {"original": "reference", "cartpole-original": "cartpole"}


def score() -> str:
    """Returns what `evaluate` prints for the shipped policy `reference`."""
    return fenced(printed_by("evaluate reference"))


def story() -> str:
    """Returns the table of the original, the fixed agent, the optimum and random torques."""
    exact = solution(Pendulum())
    optimum = float(exact.best_returns(range(EVALUATION_EPISODES)).mean())
    arms = {arm["arm"]: arm for arm in table()["rows"]}
    rows = []
    for policy, name in {
        "the original program": "original",
        "the same design, fixed": "reference",
    }.items():
        regret, low, high = (arms[name][f"regret_{part}"] for part in ("iqm", "low", "high"))
        # The starts are the same for all runs, so this is the interquartile mean of the returns.
        cells = f"{optimum - regret:.1f}", number(regret), f"{number(low)} to {number(high)}"
        rows.append((policy, *cells))
    random_return = exact.random_return()
    rows.append(("the exact optimum", f"{optimum:.1f}", "0", "–"))
    rows.append(("random torques", f"{random_return:.1f}", number(optimum - random_return), "–"))
    columns = ("policy", "mean return", "regret", "95 % interval")
    return markdown([dict(zip(columns, row, strict=True)) for row in rows])


def first_run() -> str:
    """Returns the closing lines of the first training."""
    seconds = row_of("quality", preset="`reference`")["whole command"]
    # The training evaluates its policy in the same words, and then names random actions.
    lines = printed_by("evaluate reference") + printed_by("train")
    begin = f"Installed, it trains in {seconds} on two cores and prints, among other lines:"
    return f"{begin}\n\n{fenced(lines)}"


def diagnosis() -> str:
    """Returns the first line of the diagnosis of `original`."""
    return fenced(printed_by("diagnose original")[:1])


def comparison() -> str:
    """Returns what `compare` printed."""
    lines = printed_by("compare runs/original-seed0 runs/reference-seed0")
    return "".join(f"{line}\n" for line in lines if line.startswith("|"))


def row_of(name: str, **cells: Any) -> Row:
    """Returns the first row of a result with these cells; a column's spaces are `_` here."""
    wanted = {key.replace("_", " "): value for key, value in cells.items()}
    return next(row for row in rows_of(name) if row.items() >= wanted.items())


def printed_by(command: str) -> list[str]:
    """Returns the lines that a command of benchmarks.pages.first_run printed."""
    return [row["line"] for row in rows_of("first_run") if row["command"] == command]


def fenced(lines: list[str]) -> str:
    """Returns lines as a block of code."""
    return "\n".join(["```text", *lines, "```"]) + "\n"


def quality() -> str:
    """Returns the regrets of the presets, with the statistic of the page's regrets."""
    rows = []
    for row in rows_of("quality"):
        name = row["preset"].strip("`")
        regrets = measured(MEASURED_WITH.get(name, name))[name]
        mean, interval = mean_and_interval(regrets)
        rows.append(
            {
                "preset": row["preset"],
                "task": row["task"],
                "best possible return": row["best possible return"],
                "training seeds": len(regrets),
                "regret": mean,
                "95 % interval": interval,
                "worst": number(max(regrets)),
                "whole command": row["whole command"],
            }
        )
    return f"{markdown(rows)}\nEach regret of this page is the {STATISTIC}.\n"


def presets() -> str:
    """Returns the list of the presets with their tasks."""
    return markdown(
        [
            {
                "preset": f"`{name}`",
                "task": config.task.name,
                "what it is": DESCRIPTIONS[name],
            }
            for name, config in PRESETS.items()
        ]
    )


def settings() -> str:
    """Returns the list of all settings with the values of `reference`."""
    default = kp.preset()
    return markdown(
        [
            {
                "setting": f"`{field.name}`",
                "`reference`": format_value(getattr(default, field.name)),
                "meaning": field.metadata["help"],
            }
            for field in fields(kp.Config)
        ]
    )


def departure_table(preset: str) -> str:
    """Returns a preset's departures from the earlier one with reasons and measured regrets."""
    earlier, later = kp.preset(BEFORE[preset]), kp.preset(preset)
    regrets = measured(preset)
    command = "learning.study FOLDER"
    if preset in MEASURED_HERE:
        command = f"learning.departures FOLDER {preset}"
    # Most runs of CartPole lose nothing, with and without a departure; a few lose much.
    shown = with_bad_runs if preset == "cartpole" else summary
    rows = []
    for name in departures(preset):
        if name not in REASONS[preset]:
            raise SystemExit(
                f"error: benchmarks/pages/reasons.py: {preset} has no reason for {name}"
            )
        if name not in regrets:
            raise SystemExit(
                f"error: the results have no {preset} without {name}: run "
                f"`python -m benchmarks.{command}`"
            )
        rows.append(
            {
                "setting": f"`{name}`",
                earlier.preset: format_value(getattr(earlier, name)),
                preset: format_value(getattr(later, name)),
                "why": REASONS[preset][name],
                "regret without it": shown(regrets[name]),
            }
        )
    regret_lines = "".join(
        f"- `{name}`: {shown(regrets[name])}\n" for name in (preset, earlier.preset)
    )
    seeds = len(regrets[preset])
    return (
        f"The regrets of both presets, from {seeds} training seeds:\n\n{regret_lines}\n"
        f"{markdown(rows)}"
    )


def with_bad_runs(regrets: list[float]) -> str:
    """Returns the summary of some runs, and how many of them have a regret above 0."""
    bad = sum(regret > 0 for regret in regrets)
    return f"{summary(regrets)}, {bad} of {len(regrets)} runs above 0"


def choosing() -> str:
    """Returns the settings beside `reference`, on seeds that no other result is reported for."""
    rows = rows_of("choosing")
    expected = [arm.partition(":")[0] for arm in ARMS]
    assert [row["training"] for row in rows] == expected, (
        "run benchmarks.learning.rejected_settings again"
    )
    return markdown(
        [{"settings": row["training"], "regret": summary(row["regrets"])} for row in rows]
    )
